// A subscriber that shares nothing with Clamber but the IDL: another vendor's DDS, reading what the
// publisher sends and writing it down for the test to judge.
//
//   cyclone_peer <domain> <ticks to wait for> <seconds at most>
//
// Lines: D robot joint:limit... | F tick time phase count tau_meas... q... | J count
// name:q:dq:tau...
//        MATCHED, once all three writers are known | U <user data of the joint states' writer>
#include <dds/dds.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "clamber_telemetry.h"
#include "ros2_joint_state.h"

namespace {

using Batch = clamber_msg_dds__Batch_;
using Description = clamber_msg_dds__Description_;
using JointState = sensor_msgs_msg_dds__JointState_;

dds_entity_t entity(dds_entity_t handle, const char* what) {
  if (handle >= 0) return handle;
  std::fprintf(stderr, "cyclone_peer: %s: %s\n", what, dds_strretcode(handle));
  std::exit(2);
}

dds_entity_t reader(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* name,
                    dds_reliability_kind_t reliability, dds_durability_kind_t durability) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, reliability, DDS_SECS(1));
  dds_qset_durability(qos, durability);
  dds_qset_history(qos, DDS_HISTORY_KEEP_ALL, 0);
  const dds_entity_t topic =
      entity(dds_create_topic(participant, type, name, nullptr, nullptr), name);
  const dds_entity_t handle = entity(dds_create_reader(participant, topic, qos, nullptr), name);
  dds_delete_qos(qos);
  return handle;
}

template <typename Sample, typename Use>
void take_all(dds_entity_t from, Use use) {
  void* sample = nullptr;
  dds_sample_info_t info;
  while (dds_take(from, &sample, &info, 1, 1) == 1) {
    if (info.valid_data) use(*static_cast<const Sample*>(sample));
    dds_return_loan(from, &sample, 1);
    sample = nullptr;
  }
}

void print(const Description& d) {
  std::printf("D %s", d.robot);
  for (uint32_t j = 0; j < d.joint_names._length; ++j) {
    std::printf(" %s:%.9g", d.joint_names._buffer[j], static_cast<double>(d.torque_limit[j]));
  }
  std::printf("\n");
}

void print(const clamber_msg_dds__Frame_& f) {
  std::printf("F %llu %.17g %u %u", static_cast<unsigned long long>(f.tick), f.time, f.phase,
              f.joint_count);
  for (uint32_t j = 0; j < f.joint_count; ++j) {
    std::printf(" %.9g", static_cast<double>(f.tau_meas[j]));
  }
  for (uint32_t j = 0; j < f.joint_count; ++j) std::printf(" %.9g", static_cast<double>(f.q[j]));
  std::printf("\n");
}

void print(const JointState& s) {
  std::printf("J %u", s.name._length);
  for (uint32_t j = 0; j < s.name._length; ++j) {
    std::printf(" %s:%.17g:%.17g:%.17g", s.name._buffer[j], s.position._buffer[j],
                s.velocity._buffer[j], s.effort._buffer[j]);
  }
  std::printf("\n");
}

bool is_matched(dds_entity_t from) { return dds_get_matched_publications(from, nullptr, 0) > 0; }

void print_user_data(dds_entity_t from) {
  dds_instance_handle_t writer = 0;
  dds_get_matched_publications(from, &writer, 1);
  dds_builtintopic_endpoint_t* endpoint = dds_get_matched_publication_data(from, writer);
  if (endpoint == nullptr) return;
  void* data = nullptr;
  size_t size = 0;
  dds_qget_userdata(endpoint->qos, &data, &size);
  std::printf("U %.*s\n", static_cast<int>(size), static_cast<const char*>(data));
  dds_free(data);
  dds_builtintopic_free_endpoint(endpoint);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  const auto domain = static_cast<dds_domainid_t>(std::atoi(argv[1]));
  const unsigned long long wanted = std::strtoull(argv[2], nullptr, 10);
  const std::chrono::duration<double> limit(std::atof(argv[3]));

  const dds_entity_t participant =
      entity(dds_create_participant(domain, nullptr, nullptr), "participant");
  const dds_entity_t description = reader(participant, &clamber_msg_dds__Description__desc,
                                          "rt/test_robot/telemetry/description",
                                          DDS_RELIABILITY_RELIABLE, DDS_DURABILITY_TRANSIENT_LOCAL);
  const dds_entity_t joint_states =
      reader(participant, &sensor_msgs_msg_dds__JointState__desc, "rt/joint_states",
             DDS_RELIABILITY_RELIABLE, DDS_DURABILITY_VOLATILE);
  const dds_entity_t frames =
      reader(participant, &clamber_msg_dds__Batch__desc, "rt/test_robot/telemetry/frames",
             DDS_RELIABILITY_BEST_EFFORT, DDS_DURABILITY_VOLATILE);

  unsigned long long ticks = 0;
  bool matched = false;
  const auto receive = [&] {
    take_all<Description>(description, [](const Description& d) { print(d); });
    take_all<JointState>(joint_states, [](const JointState& s) { print(s); });
    take_all<Batch>(frames, [&](const Batch& batch) {
      for (uint32_t i = 0; i < batch.count; ++i) print(batch.frames[i]);
      ticks += batch.count;
    });
    if (!matched && is_matched(description) && is_matched(frames) && is_matched(joint_states)) {
      matched = true;
      print_user_data(joint_states);
      std::printf("MATCHED\n");
      std::fflush(stdout);
    }
  };
  const auto start = std::chrono::steady_clock::now();
  while (ticks < wanted && std::chrono::steady_clock::now() - start < limit) {
    receive();
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(200));  // what comes beside the last frame
  receive();
  dds_delete(participant);
  return 0;
}
