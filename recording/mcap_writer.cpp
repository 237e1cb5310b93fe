#include "recording/mcap_writer.hpp"

#include <fcntl.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <vector>

#include "recording/mcap_format.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

using mcap::Bytes;
using mcap::Opcode;

constexpr std::size_t kChunkBytes = 1u << 20;
constexpr std::uint64_t kChunkTime = 1'000'000'000;  // ns

std::uint32_t checksum(std::uint32_t before, std::string_view bytes) {
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

/// A file that holds whole blocks only, and the checksum of all of them.
class BlockFile {
 public:
  explicit BlockFile(std::filesystem::path file)
      : file_(std::move(file)),
        descriptor_(open(file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644)) {
    if (descriptor_ < 0) fail();
  }
  ~BlockFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  BlockFile(const BlockFile&) = delete;
  BlockFile& operator=(const BlockFile&) = delete;

  /// Appends all of `block`, or nothing. @throws InputError
  void append(std::string_view block) {
    for (std::string_view rest = block; !rest.empty();) {
      const ssize_t written = ::write(descriptor_, rest.data(), rest.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) {
        const int error = errno;
        // Failing too, it leaves a cut block, which readers must expect in any case.
        static_cast<void>(ftruncate(descriptor_, static_cast<off_t>(size_)));
        errno = error;
        fail();
      }
      rest.remove_prefix(static_cast<std::size_t>(written));
    }
    size_ += block.size();
    checksum_ = checksum(checksum_, block);
  }
  void close() {
    const int result = ::close(descriptor_);
    descriptor_ = -1;
    if (result != 0) fail();
  }
  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] std::uint32_t all() const { return checksum_; }

 private:
  [[noreturn]] void fail() const {
    const std::string kept =
        size_ > 0 ? "; what was written before is whole: " + std::to_string(size_) + " bytes" : "";
    throw InputError(file_.string() + ": cannot write: " + std::string(std::strerror(errno)) +
                     kept);
  }

  std::filesystem::path file_;
  int descriptor_;
  std::uint64_t size_ = 0;
  std::uint32_t checksum_ = 0;
};

struct TimeRange {
  std::uint64_t first = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t last = 0;

  [[nodiscard]] bool empty() const { return first > last; }
  void add(std::uint64_t time) {
    first = std::min(first, time);
    last = std::max(last, time);
  }
  /// Of no messages: 0 to 0, as the format has it.
  void write_to(Bytes& bytes) const {
    bytes.number(empty() ? std::uint64_t{0} : first);
    bytes.number(last);
  }
};

struct Channel {
  std::string record;    ///< content of its Channel record
  std::uint16_t schema;  ///< index, from 0
  std::uint64_t messages = 0;
  /// Of the open chunk: time of each message and where its record starts.
  std::vector<std::pair<std::uint64_t, std::uint64_t>> index;
};

struct Schema {
  std::string name;
  std::string record;  ///< content of its Schema record
};

}  // namespace

class McapWriter::Impl {
 public:
  Impl(std::filesystem::path file, const std::string& profile, const std::string& library)
      : file_(std::move(file)) {
    Bytes header;
    header.text(profile);
    header.text(library);
    Bytes start;
    start.raw(mcap::kMagic);
    start.record(Opcode::kHeader, header.view());
    file_.append(start.view());
  }

  void add_metadata(const std::string& name, const std::map<std::string, std::string>& entries) {
    Bytes content;
    content.text(name);
    content.text_map(entries);
    Bytes record;
    record.record(Opcode::kMetadata, content.view());
    Bytes index;
    index.number(file_.size());
    index.number(static_cast<std::uint64_t>(record.size()));
    index.text(name);
    metadata_index_.record(Opcode::kMetadataIndex, index.view());
    ++metadata_count_;
    file_.append(record.view());
  }

  std::uint16_t add_channel(const std::string& topic, const McapSchema& schema,
                            const std::string& message_encoding) {
    const std::uint16_t schema_index = find_or_add(schema);
    Bytes content;
    content.number(static_cast<std::uint16_t>(channels_.size()));
    content.number(static_cast<std::uint16_t>(schema_index + 1));  // 0 means: none
    content.text(topic);
    content.text(message_encoding);
    content.text_map({});
    channels_.push_back({.record = std::string(content.view()),
                         .schema = schema_index,
                         .messages = 0,
                         .index = {}});
    chunk_.record(Opcode::kChannel, channels_.back().record);
    return static_cast<std::uint16_t>(channels_.size() - 1);
  }

  void write(std::uint16_t channel, std::uint64_t time, std::uint64_t published,
             std::string_view message) {
    if (chunk_.size() >= kChunkBytes ||
        (!chunk_times_.empty() && time >= chunk_times_.first + kChunkTime))
      flush();
    Channel& used = channels_.at(channel);
    used.index.emplace_back(time, chunk_.size());
    message_.clear();
    message_.number(channel);
    message_.number(static_cast<std::uint32_t>(used.messages));
    message_.number(time);
    message_.number(published);
    message_.raw(message);
    chunk_.record(Opcode::kMessage, message_.view());
    chunk_times_.add(time);
    ++used.messages;
    ++messages_;
  }

  void flush() {
    if (chunk_.empty()) return;
    Bytes block;
    write_chunk(block);
    const std::uint64_t chunk_length = block.size();
    Bytes offsets;
    write_message_indices(block, offsets);

    Bytes index;
    chunk_times_.write_to(index);
    index.number(file_.size());
    index.number(chunk_length);
    index.text(offsets.view());
    index.number(static_cast<std::uint64_t>(block.size() - chunk_length));
    index.text("");  // compression: none
    index.number(static_cast<std::uint64_t>(chunk_.size()));
    index.number(static_cast<std::uint64_t>(chunk_.size()));

    file_.append(block.view());
    chunk_index_.record(Opcode::kChunkIndex, index.view());
    ++chunk_count_;
    if (!chunk_times_.empty()) {
      times_.add(chunk_times_.first);
      times_.add(chunk_times_.last);
    }
    chunk_.clear();
    chunk_times_ = {};
  }

  void close() {
    flush();
    Bytes end;
    Bytes data_end;
    data_end.number(file_.all());
    end.record(Opcode::kDataEnd, data_end.view());
    file_.append(end.view());
    file_.append(summary());
    file_.close();
  }

  [[nodiscard]] std::uint64_t messages() const { return messages_; }
  [[nodiscard]] std::uint64_t bytes() const { return file_.size(); }

 private:
  std::uint16_t find_or_add(const McapSchema& schema) {
    const auto known = std::find_if(schemas_.begin(), schemas_.end(),
                                    [&](const Schema& s) { return s.name == schema.name; });
    const auto index = static_cast<std::uint16_t>(known - schemas_.begin());
    if (known != schemas_.end()) return index;
    Bytes content;
    content.number(static_cast<std::uint16_t>(index + 1));
    content.text(schema.name);
    content.text(schema.encoding);
    content.text(schema.text);
    schemas_.push_back({schema.name, std::string(content.view())});
    chunk_.record(Opcode::kSchema, schemas_.back().record);
    return index;
  }

  void write_chunk(Bytes& block) const {
    Bytes content;
    chunk_times_.write_to(content);
    content.number(static_cast<std::uint64_t>(chunk_.size()));
    content.number(checksum(0, chunk_.view()));
    content.text("");  // compression: none
    content.number(static_cast<std::uint64_t>(chunk_.size()));
    content.raw(chunk_.view());
    block.record(Opcode::kChunk, content.view());
  }

  /// @param offsets where each channel's index record stands in the file
  void write_message_indices(Bytes& block, Bytes& offsets) {
    for (std::size_t c = 0; c < channels_.size(); ++c) {
      Channel& channel = channels_[c];
      if (channel.index.empty()) continue;
      const auto id = static_cast<std::uint16_t>(c);
      offsets.number(id);
      offsets.number(static_cast<std::uint64_t>(file_.size() + block.size()));
      Bytes entries;
      for (const auto& [time, offset] : channel.index) {
        entries.number(time);
        entries.number(offset);
      }
      Bytes index;
      index.number(id);
      index.text(entries.view());
      block.record(Opcode::kMessageIndex, index.view());
      channel.index.clear();
    }
  }

  [[nodiscard]] Bytes statistics() const {
    Bytes statistics;
    statistics.number(messages_);
    statistics.number(static_cast<std::uint16_t>(schemas_.size()));
    statistics.number(static_cast<std::uint32_t>(channels_.size()));
    statistics.number(std::uint32_t{0});  // attachments
    statistics.number(metadata_count_);
    statistics.number(chunk_count_);
    times_.write_to(statistics);
    Bytes counts;
    for (std::size_t c = 0; c < channels_.size(); ++c) {
      counts.number(static_cast<std::uint16_t>(c));
      counts.number(channels_[c].messages);
    }
    statistics.text(counts.view());
    return statistics;
  }

  /// All that comes after the data: groups of records, where each group is, footer, magic.
  [[nodiscard]] std::string summary() const {
    const std::uint64_t start = file_.size();
    Bytes out;
    Bytes offsets;
    const auto group = [&](Opcode opcode, const Bytes& records) {
      if (records.empty()) return;
      Bytes offset;
      offset.number(opcode);
      offset.number(start + out.size());
      offset.number(static_cast<std::uint64_t>(records.size()));
      offsets.record(Opcode::kSummaryOffset, offset.view());
      out.raw(records.view());
    };
    Bytes schemas;
    for (const Schema& schema : schemas_) schemas.record(Opcode::kSchema, schema.record);
    Bytes channels;
    for (const Channel& channel : channels_) channels.record(Opcode::kChannel, channel.record);
    Bytes statistics_record;
    statistics_record.record(Opcode::kStatistics, statistics().view());
    group(Opcode::kSchema, schemas);
    group(Opcode::kChannel, channels);
    group(Opcode::kStatistics, statistics_record);
    group(Opcode::kMetadataIndex, metadata_index_);
    group(Opcode::kChunkIndex, chunk_index_);

    const std::uint64_t offsets_start = start + out.size();
    out.raw(offsets.view());
    out.number(Opcode::kFooter);
    out.number(std::uint64_t{8 + 8 + 4});
    out.number(start);
    out.number(offsets_start);
    out.number(checksum(0, out.view()));
    out.raw(mcap::kMagic);
    return std::string(out.view());
  }

  BlockFile file_;
  std::vector<Schema> schemas_;
  std::vector<Channel> channels_;
  Bytes chunk_;  ///< records of the open chunk
  TimeRange chunk_times_;
  TimeRange times_;
  Bytes message_;  ///< scratch
  Bytes chunk_index_;
  Bytes metadata_index_;
  std::uint32_t chunk_count_ = 0;
  std::uint32_t metadata_count_ = 0;
  std::uint64_t messages_ = 0;
};

McapWriter::McapWriter(std::filesystem::path file, const std::string& profile,
                       const std::string& library)
    : impl_(std::make_unique<Impl>(std::move(file), profile, library)) {}
McapWriter::~McapWriter() = default;

void McapWriter::add_metadata(const std::string& name,
                              const std::map<std::string, std::string>& entries) {
  impl_->add_metadata(name, entries);
}
std::uint16_t McapWriter::add_channel(const std::string& topic, const McapSchema& schema,
                                      const std::string& message_encoding) {
  return impl_->add_channel(topic, schema, message_encoding);
}
void McapWriter::write(std::uint16_t channel, std::uint64_t time, std::uint64_t published,
                       std::string_view message) {
  impl_->write(channel, time, published, message);
}
void McapWriter::flush() { impl_->flush(); }
void McapWriter::close() { impl_->close(); }
std::uint64_t McapWriter::messages() const { return impl_->messages(); }
std::uint64_t McapWriter::bytes() const { return impl_->bytes(); }

}  // namespace clamber
