#include "apps/bus_listener.hpp"

#include <algorithm>

#include "firmware_hal/codec/canopen.hpp"

namespace clamber {
namespace {

constexpr std::int64_t kAfterAFrame = 500'000;         // ns
constexpr std::int64_t kLookForSignals = 100'000'000;  // ns

}  // namespace

BusListener::BusListener(const BusMap& map)
    : map_(map), ports_(open_ports(map)), inbox_(256), nodes_(map.buses.size()) {
  for (const Bus& bus : map_.buses) watches_.emplace_back(bus);
}

void BusListener::listen(std::int64_t until, const std::atomic<bool>* stop) {
  for (std::int64_t now = this->now(); now < until; now = this->now()) {
    if (stop != nullptr && stop->load()) return;
    ports_.clock->wait(std::min(until, now + kLookForSignals));
    for (std::size_t b = 0; b < watches_.size(); ++b) {
      ports_.ports[b]->maintain(now);
      std::size_t count = inbox_.size();
      while (count == inbox_.size()) {
        count = ports_.ports[b]->receive(inbox_);
        for (std::size_t i = 0; i < count; ++i) {
          watches_[b].take(inbox_[i]);
          note_node(b, inbox_[i].frame);
        }
      }
    }
  }
}

void BusListener::send(std::size_t bus, const CanFrame& frame) {
  (void)ports_.ports[bus]->send({&frame, 1});
  listen(now() + kAfterAFrame);
}

std::uint64_t BusListener::commands() const {
  std::uint64_t heard = 0;
  for (std::size_t b = 0; b < watches_.size(); ++b)
    for (std::size_t i = 0; i < map_.buses[b].drives.size(); ++i)
      heard += watches_[b].drive(i).commands;
  return heard;
}

void BusListener::note_node(std::size_t bus, const CanFrame& frame) {
  Sdo sdo;
  bool request = false;
  if (map_.buses[bus].protocol != BusProtocol::kCia402 ||
      decode_sdo(frame, sdo, request) != CodecStatus::kOk || request)
    return;
  const std::uint32_t value = sdo.kind == SdoKind::kUploadReply ? sdo.value : 0;
  if (sdo.index == 0x1000)
    nodes_[bus][sdo.node].device_type = value;
  else if (sdo.index == 0x1001)
    nodes_[bus][sdo.node].error = value;
  else
    return;
  ++nodes_[bus][sdo.node].answers;
}

std::vector<CanFrame> questions_to(const Bus& bus, std::uint16_t object,
                                   std::span<const std::uint8_t> nodes) {
  std::vector<CanFrame> questions;
  if (bus.protocol == BusProtocol::kMit) {
    for (const JointDrive& drive : bus.drives)
      questions.push_back(encode_mit_special(mit_drive(bus, drive), MitSpecial::kDisable));
    return questions;
  }
  Sdo question;
  question.kind = SdoKind::kUpload;
  question.index = object;
  for (const std::uint8_t node : nodes) {
    question.node = node;
    questions.push_back(encode_sdo(question, true));
  }
  return questions;
}

}  // namespace clamber
