#include "recording/mcap_reader.hpp"

#include <zlib.h>

#include <algorithm>
#include <utility>

#include "recording/mcap_format.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

using mcap::Fields;
using mcap::Opcode;

// Of any record: a chunk of ours has a megabyte. Others may write larger ones.
constexpr std::uint64_t kLargestRecord = 256u << 20;

}  // namespace

McapReader::McapReader(std::filesystem::path file)
    : file_(std::move(file)),
      in_(open_file(file_, kRunLogBytes)),
      left_(std::filesystem::file_size(file_)) {
  std::string magic(mcap::kMagic.size(), '\0');
  if (!in_.read(magic.data(), static_cast<std::streamsize>(magic.size())) || magic != mcap::kMagic)
    fail("not an MCAP file");
  left_ -= magic.size();
}

void McapReader::fail(const std::string& what) const {
  throw InputError(file_.string() + ": " + what);
}

bool McapReader::next(McapMessage& message) {
  for (;;) {
    while (!chunk_.empty()) {
      Fields fields(chunk_);
      const auto opcode = fields.number<Opcode>();
      const std::string_view content = fields.raw(fields.number<std::uint64_t>());
      if (!fields.ok()) fail("a chunk with a record that is longer than the chunk");
      chunk_ = fields.rest();
      if (opcode == Opcode::kSchema) take_schema(content);
      if (opcode == Opcode::kChannel) take_channel(content);
      if (opcode == Opcode::kMessage && take_message(content, message)) return true;
    }
    if (!next_chunk()) return false;
  }
}

bool McapReader::next_chunk() {
  while (!ended_) {
    char head[mcap::kRecordHead];
    if (left_ < sizeof head || !in_.read(head, sizeof head)) {
      cut_ = ended_ = true;
      return false;
    }
    left_ -= sizeof head;
    Fields fields({head, sizeof head});
    const auto opcode = fields.number<Opcode>();
    const auto length = fields.number<std::uint64_t>();
    if (length > left_) {
      cut_ = ended_ = true;
      return false;
    }
    if (length > kLargestRecord) fail("a record of " + std::to_string(length) + " bytes");
    record_.resize(length);
    if (!in_.read(record_.data(), static_cast<std::streamsize>(length))) fail("cannot be read");
    left_ -= length;
    switch (opcode) {
      case Opcode::kDataEnd:
      case Opcode::kFooter:
        ended_ = true;
        break;
      case Opcode::kMetadata: {
        Fields metadata(record_);
        const std::string name(metadata.text());
        metadata_[name] = metadata.text_map();
        break;
      }
      case Opcode::kChunk:
        open_chunk();
        return true;
      default:
        break;
    }
  }
  return false;
}

void McapReader::open_chunk() {
  Fields fields(record_);
  fields.raw(8 + 8);  // times of its first and last message
  fields.number<std::uint64_t>();
  const auto expected = fields.number<std::uint32_t>();
  const std::string_view compression = fields.text();
  const std::string_view records = fields.raw(fields.number<std::uint64_t>());
  if (!fields.ok()) fail("a chunk that is shorter than it says");
  if (!compression.empty())
    fail("compressed with " + std::string(compression) + ": only uncompressed files are read");
  const auto found = static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(records.data()), records.size()));
  if (expected != 0 && expected != found) fail("a chunk whose checksum is wrong");
  chunk_ = records;
}

void McapReader::take_schema(std::string_view content) {
  Fields fields(content);
  const auto id = fields.number<std::uint16_t>();
  schemas_[id] = fields.text();
}

void McapReader::take_channel(std::string_view content) {
  Fields fields(content);
  const auto id = fields.number<std::uint16_t>();
  const auto schema = fields.number<std::uint16_t>();
  channels_[id] = {.topic = std::string(fields.text()), .schema = schemas_[schema]};
}

bool McapReader::take_message(std::string_view content, McapMessage& message) const {
  Fields fields(content);
  const auto channel = channels_.find(fields.number<std::uint16_t>());
  fields.number<std::uint32_t>();  // sequence
  const auto time = fields.number<std::uint64_t>();
  fields.number<std::uint64_t>();  // published
  if (!fields.ok() || channel == channels_.end()) fail("a message of no channel");
  message = {.topic = channel->second.topic,
             .schema = channel->second.schema,
             .time = time,
             .data = fields.rest()};
  return true;
}

}  // namespace clamber
