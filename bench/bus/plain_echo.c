#include "bench/bus/plain_echo.h"

#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

int plain_open(const char* interface) {
  struct sockaddr_can address;
  const int on = 1;
  const int buffer = 8 << 20;
  const int s = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK, CAN_RAW);
  if (s < 0) return -1;
  setsockopt(s, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
  setsockopt(s, SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer);
  memset(&address, 0, sizeof address);
  address.can_family = AF_CAN;
  address.can_ifindex = (int)if_nametoindex(interface);
  if (address.can_ifindex == 0 || bind(s, (struct sockaddr*)&address, sizeof address) != 0) {
    close(s);
    return -1;
  }
  return s;
}

static void wait_for(const int* sockets, int buses, struct pollfd* polled, int milliseconds) {
  for (int b = 0; b < buses; ++b) {
    polled[b].fd = sockets[b];
    polled[b].events = POLLIN;
    polled[b].revents = 0;
  }
  poll(polled, (nfds_t)buses, milliseconds);
}

void plain_answer(const int* sockets, int buses) {
  struct pollfd polled[kMostBuses];
  struct canfd_frame frame;
  for (;;) {
    wait_for(sockets, buses, polled, -1);
    for (int b = 0; b < buses; ++b) {
      if (polled[b].revents == 0) continue;
      while (read(sockets[b], &frame, sizeof frame) == CANFD_MTU) {
        const __u8 id = (__u8)frame.can_id;
        frame.can_id += 0x400;
        memset(frame.data, 0x7F, frame.len);
        frame.data[0] = (__u8)(0x10 | (id & 0xF)); /* state: on; low bits of the id */
        if (write(sockets[b], &frame, CANFD_MTU) != CANFD_MTU) continue;
      }
    }
  }
}

int plain_exchange(const int* sockets, int buses, const unsigned* ids, const int* ids_per_bus) {
  struct pollfd polled[kMostBuses];
  struct canfd_frame frame;
  int missing = 0;
  memset(&frame, 0, sizeof frame);
  frame.len = 8;
  frame.flags = CANFD_BRS;
  for (int b = 0; b < buses; ++b)
    for (int i = 0; i < ids_per_bus[b]; ++i) {
      frame.can_id = *ids++;
      if (write(sockets[b], &frame, CANFD_MTU) == CANFD_MTU) ++missing;
    }
  while (missing > 0) {
    const int before = missing;
    wait_for(sockets, buses, polled, 100);
    for (int b = 0; b < buses; ++b) {
      if (polled[b].revents == 0) continue;
      while (read(sockets[b], &frame, sizeof frame) == CANFD_MTU) --missing;
    }
    if (missing == before) return -1;
  }
  return 0;
}
