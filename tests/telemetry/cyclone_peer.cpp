// A subscriber that shares nothing with Clamber but the IDL: another vendor's DDS, reading what the
// publisher sends and writing it down for the test to judge.
//
//   cyclone_peer <domain> <ticks to wait for> <seconds at most>
//
// Lines: D robot joint:limit... | F tick time phase count tau_meas... q... | J count
// name:q:dq:tau...
//        E number tick kind severity joint text | S topic number tick (torque_margins, timing, ...)
//        X transforms child:parent... | G status name:level... | URDF bytes
//        READER <topic>, of another participant
//        MATCHED, once all writers are known | U <topic> <user data of its writer>
#include <dds/dds.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>

#include "clamber_telemetry.h"
#include "ros2_messages.h"

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

void print(const clamber_msg_dds__Event_& e) {
  std::printf("E %llu %llu %u %u %d %s\n", static_cast<unsigned long long>(e.number),
              static_cast<unsigned long long>(e.tick), e.kind, e.severity, e.joint, e.text);
}

template <typename Sample>
void print_numbered(const char* topic, const Sample& s) {
  std::printf("S %s %llu %llu\n", topic, static_cast<unsigned long long>(s.number),
              static_cast<unsigned long long>(s.tick));
}

void print(const tf2_msgs_msg_dds__TFMessage_& m) {
  std::printf("X %u", m.transforms._length);
  for (uint32_t i = 0; i < m.transforms._length; ++i) {
    const auto& t = m.transforms._buffer[i];
    std::printf(" %s:%s:%.9g:%.9g", t.child_frame_id, t.header.frame_id, t.transform.rotation.w,
                t.transform.translation.z);
  }
  std::printf("\n");
}

void print(const diagnostic_msgs_msg_dds__DiagnosticArray_& a) {
  std::printf("G %u", a.status._length);
  for (uint32_t i = 0; i < a.status._length; ++i)
    std::printf(" [%s]=%u", a.status._buffer[i].name, a.status._buffer[i].level);
  std::printf("\n");
}

bool is_matched(dds_entity_t from) { return dds_get_matched_publications(from, nullptr, 0) > 0; }

void print_user_data(const char* topic, dds_entity_t from) {
  dds_instance_handle_t writer = 0;
  dds_get_matched_publications(from, &writer, 1);
  dds_builtintopic_endpoint_t* endpoint = dds_get_matched_publication_data(from, writer);
  if (endpoint == nullptr) return;
  void* data = nullptr;
  size_t size = 0;
  dds_qget_userdata(endpoint->qos, &data, &size);
  std::printf("U %s %.*s\n", topic, static_cast<int>(size), static_cast<const char*>(data));
  dds_free(data);
  dds_builtintopic_free_endpoint(endpoint);
}

/// Readers of other participants: what anybody on the network could send to.
void print_foreign_readers(dds_entity_t participant, dds_entity_t readers) {
  dds_guid_t own;
  dds_get_guid(participant, &own);
  take_all<dds_builtintopic_endpoint_t>(readers, [&](const dds_builtintopic_endpoint_t& reader) {
    if (std::memcmp(&reader.participant_key, &own, sizeof own) != 0)
      std::printf("READER %s\n", reader.topic_name);
  });
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  const auto domain = static_cast<dds_domainid_t>(std::atoi(argv[1]));
  const unsigned long long wanted = std::strtoull(argv[2], nullptr, 10);
  const std::chrono::duration<double> limit(std::atof(argv[3]));

  const dds_entity_t participant =
      entity(dds_create_participant(domain, nullptr, nullptr), "participant");
  const std::string own = "rt/test_robot/telemetry/";
  const auto measured = [&](const dds_topic_descriptor_t* type, const std::string& name) {
    return reader(participant, type, name.c_str(), DDS_RELIABILITY_BEST_EFFORT,
                  DDS_DURABILITY_VOLATILE);
  };
  const auto reliable = [&](const dds_topic_descriptor_t* type, const std::string& name) {
    return reader(participant, type, name.c_str(), DDS_RELIABILITY_RELIABLE,
                  DDS_DURABILITY_VOLATILE);
  };
  const auto kept = [&](const dds_topic_descriptor_t* type, const std::string& name) {
    return reader(participant, type, name.c_str(), DDS_RELIABILITY_RELIABLE,
                  DDS_DURABILITY_TRANSIENT_LOCAL);
  };
  const dds_entity_t description = kept(&clamber_msg_dds__Description__desc, own + "description");
  const dds_entity_t events = kept(&clamber_msg_dds__Event__desc, own + "events");
  const dds_entity_t urdf = kept(&std_msgs_msg_dds__String__desc, "rt/robot_description");
  const dds_entity_t tf_static = kept(&tf2_msgs_msg_dds__TFMessage__desc, "rt/tf_static");
  const dds_entity_t tf = reliable(&tf2_msgs_msg_dds__TFMessage__desc, "rt/tf");
  const dds_entity_t diagnostics =
      reliable(&diagnostic_msgs_msg_dds__DiagnosticArray__desc, "rt/diagnostics");
  const dds_entity_t joint_states =
      reliable(&sensor_msgs_msg_dds__JointState__desc, "rt/joint_states");
  const dds_entity_t torques =
      measured(&clamber_msg_dds__TorqueMargins__desc, own + "torque_margins");
  const dds_entity_t timing = measured(&clamber_msg_dds__Timing__desc, own + "timing");
  const dds_entity_t bus = measured(&clamber_msg_dds__BusHealth__desc, own + "bus");
  const dds_entity_t contacts = measured(&clamber_msg_dds__Contacts__desc, own + "contacts");
  const dds_entity_t frames = measured(&clamber_msg_dds__Batch__desc, own + "frames");
  const std::array all{description,  events,  urdf,   tf_static, tf,       diagnostics,
                       joint_states, torques, timing, bus,       contacts, frames};

  const dds_entity_t foreign_readers =
      entity(dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION, nullptr, nullptr),
             "readers");

  unsigned long long ticks = 0;
  bool matched = false;
  const auto receive = [&] {
    take_all<Description>(description, [](const Description& d) { print(d); });
    take_all<JointState>(joint_states, [](const JointState& s) { print(s); });
    take_all<clamber_msg_dds__Event_>(events, [](const auto& e) { print(e); });
    take_all<std_msgs_msg_dds__String_>(
        urdf, [](const auto& text) { std::printf("URDF %zu\n", std::strlen(text.data)); });
    for (const dds_entity_t from : {tf, tf_static})
      take_all<tf2_msgs_msg_dds__TFMessage_>(from, [](const auto& m) { print(m); });
    take_all<diagnostic_msgs_msg_dds__DiagnosticArray_>(diagnostics,
                                                        [](const auto& a) { print(a); });
    take_all<clamber_msg_dds__TorqueMargins_>(
        torques, [](const auto& s) { print_numbered("torque_margins", s); });
    take_all<clamber_msg_dds__Timing_>(timing, [](const auto& s) { print_numbered("timing", s); });
    take_all<clamber_msg_dds__BusHealth_>(bus, [](const auto& s) { print_numbered("bus", s); });
    take_all<clamber_msg_dds__Contacts_>(contacts,
                                         [](const auto& s) { print_numbered("contacts", s); });
    take_all<Batch>(frames, [&](const Batch& batch) {
      for (uint32_t i = 0; i < batch.count; ++i) print(batch.frames[i]);
      ticks += batch.count;
    });
    if (!matched && std::all_of(all.begin(), all.end(), is_matched)) {
      matched = true;
      print_user_data("joint_states", joint_states);
      print_user_data("tf", tf);
      print_user_data("robot_description", urdf);
      print_user_data("diagnostics", diagnostics);
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
  print_foreign_readers(participant, foreign_readers);
  dds_delete(participant);
  return 0;
}
