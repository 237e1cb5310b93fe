/* The plainest exchange over CAN sockets: write() every frame, poll(), read() every answer. The
 * other side answers frame by frame. What the motor bus is compared with. Benchmarks only. */
#ifndef CLAMBER_BENCH_PLAIN_ECHO_H
#define CLAMBER_BENCH_PLAIN_ECHO_H

#ifdef __cplusplus
extern "C" {
#endif

enum { kMostBuses = 16 };

/* @return a CAN FD socket bound to the interface; -1: errno */
int plain_open(const char* interface);

/* Answers every frame with id `n` by one with id `n` + 0x400, as an MIT drive that is on. For ever.
 */
void plain_answer(const int* sockets, int buses);

/* Sends frames of 8 bytes with the given ids on every bus and reads as many answers.
 * @return 0; -1: answers did not come within 100 ms */
int plain_exchange(const int* sockets, int buses, const unsigned* ids, const int* ids_per_bus);

#ifdef __cplusplus
}
#endif

#endif
