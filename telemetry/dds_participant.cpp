#include "telemetry/dds_participant.hpp"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <stdexcept>

#include "robot_model/loader.hpp"

#ifdef __SANITIZE_ADDRESS__
// Debian's Fast DDS 2.9.1 deletes its writers' statistics as another type than it created them.
extern "C" const char* __asan_default_options();
extern "C" const char* __asan_default_options() { return "new_delete_type_mismatch=0"; }
#endif

namespace clamber {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastdds::rtps;
using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;

constexpr std::uint32_t kSocketBuffer = 4u << 20;  // the kernel cuts it to net.core.[rw]mem_max
constexpr std::uint32_t kPeersPerMachine = 10;

Locator_t peer(const std::string& address) {
  Locator_t locator;  // port 0: Fast DDS fills in the domain's ports
  locator.kind = LOCATOR_KIND_UDPv4;
  IPLocator::setIPv4(locator, address);
  return locator;
}

/// Replaces the built-in transports, which would use every interface and shared memory.
void restrict_to(const std::vector<std::string>& addresses, dds::DomainParticipantQos& qos) {
  auto udp = std::make_shared<rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = addresses;
  udp->receiveBufferSize = kSocketBuffer;
  udp->sendBufferSize = kSocketBuffer;
  udp->maxInitialPeersRange = kPeersPerMachine;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);

  auto& peers = qos.wire_protocol().builtin.initialPeersList;
  peers.push_back(peer("239.255.0.1"));  // RTPS standard, 9.6.1.4.1
  // Linux brings its loopback up without multicast: peers there are looked for one by one.
  for (const std::string& address : addresses) {
    if (address.starts_with("127.")) peers.push_back(peer(address));
  }
}

/// Defaults need 3 s in one start of ten; this finds its peers within half a second.
void hasten_discovery(dds::DomainParticipantQos& qos) {
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  discovery.initial_announcements.count = 20;
  discovery.initial_announcements.period = Duration_t(0, 50'000'000);
  discovery.leaseDuration_announcementperiod = Duration_t(0, 250'000'000);
  discovery.leaseDuration = Duration_t(2, 0);
}

/// Credentials as scripts/dds_security lays them out.
void secure(const std::string& folder, dds::DomainParticipantQos& qos) {
  const std::filesystem::path base = std::filesystem::absolute(folder);
  const auto file = [&base](const char* name) {
    const std::filesystem::path path = base / name;
    if (!std::filesystem::is_regular_file(path))
      throw InputError("telemetry: security: " + path.string() +
                       ": no such file; scripts/dds_security makes it");
    return "file://" + path.string();
  };
  auto& properties = qos.properties().properties();
  properties.emplace_back("dds.sec.auth.plugin", "builtin.PKI-DH");
  const std::string identity = "dds.sec.auth.builtin.PKI-DH.";
  properties.emplace_back(identity + "identity_ca", file("ca.pem"));
  properties.emplace_back(identity + "identity_certificate", file("certificate.pem"));
  properties.emplace_back(identity + "private_key", file("key.pem"));
  properties.emplace_back("dds.sec.access.plugin", "builtin.Access-Permissions");
  const std::string access = "dds.sec.access.builtin.Access-Permissions.";
  properties.emplace_back(access + "permissions_ca", file("ca.pem"));
  properties.emplace_back(access + "governance", file("governance.p7s"));
  properties.emplace_back(access + "permissions", file("permissions.p7s"));
  properties.emplace_back("dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC");
}

template <typename T>
T& created(T* object, const std::string& what) {
  if (object == nullptr) throw std::runtime_error("telemetry: Fast DDS cannot create " + what);
  return *object;
}

}  // namespace

DdsParticipant::DdsParticipant(const TelemetryConfig& config, const std::string& name) {
  dds::DomainParticipantQos qos;
  qos.name(name);
  restrict_to(interface_addresses(config), qos);
  hasten_discovery(qos);
  if (!config.security.empty()) secure(config.security, qos);
  const auto domain = static_cast<dds::DomainId_t>(config.domain);
  participant_ =
      &created(dds::DomainParticipantFactory::get_instance()->create_participant(domain, qos),
               "a participant in domain " + std::to_string(config.domain));
  publisher_ = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
  subscriber_ = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
}

DdsParticipant::~DdsParticipant() {
  participant_->delete_contained_entities();
  dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

dds::Topic& DdsParticipant::create_topic(const std::string& topic, const dds::TypeSupport& type) {
  type.register_type(participant_);
  return created(participant_->create_topic(topic, type.get_type_name(), dds::TOPIC_QOS_DEFAULT),
                 "topic " + topic);
}

dds::DataWriter& DdsParticipant::create_writer(const std::string& topic,
                                               const dds::TypeSupport& type,
                                               dds::DataWriterQos qos) {
  qos.data_sharing().off();  // its files stay in /dev/shm after a crash, for no gain at this rate
  return created(
      created(publisher_, "a publisher").create_datawriter(&create_topic(topic, type), qos),
      "a writer of " + topic);
}

dds::DataReader& DdsParticipant::create_reader(const std::string& topic,
                                               const dds::TypeSupport& type,
                                               dds::DataReaderQos qos) {
  qos.data_sharing().off();
  return created(
      created(subscriber_, "a subscriber").create_datareader(&create_topic(topic, type), qos),
      "a reader of " + topic);
}

}  // namespace clamber
