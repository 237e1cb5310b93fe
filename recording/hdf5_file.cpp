#include <hdf5.h>

#include <array>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "recording/frame_fields.hpp"
#include "recording/run_file.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr hsize_t kRows = 1024;  ///< of a block, in memory and in the file

/// Closes what the library opened.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Handle() = default;
  Handle(hid_t id, Close close) : id_(id), close_(close) {}
  Handle(Handle&& other) noexcept
      : id_(std::exchange(other.id_, H5I_INVALID_HID)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  ~Handle() { reset(); }
  bool reset() { return id_ < 0 || close_(std::exchange(id_, H5I_INVALID_HID)) >= 0; }
  [[nodiscard]] hid_t id() const { return id_; }

 private:
  hid_t id_ = H5I_INVALID_HID;
  Close close_ = nullptr;
};

/// One field of the frames: a block of rows in memory, the rest in its data set.
struct Column {
  Handle set;
  hid_t type = H5I_INVALID_HID;  ///< of an entry; one of the library's own, never closed
  hsize_t width = 0;             ///< entries a row; 0: the data set is a vector
  std::size_t row_bytes = 0;
  std::vector<char> block;
};

hid_t type_of(std::uint64_t /*tag*/) { return H5T_NATIVE_UINT64; }
hid_t type_of(std::uint32_t /*tag*/) { return H5T_NATIVE_UINT32; }
hid_t type_of(double /*tag*/) { return H5T_NATIVE_DOUBLE; }

class Hdf5File final : public RunFile {
 public:
  Hdf5File(std::filesystem::path path, const RunDescription& run)
      : path_(std::move(path)),
        joints_(run.telemetry.joint_names.size()),
        contacts_(run.telemetry.contact_names.size()) {
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // what goes wrong is said in our words
    file_ = checked(H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose);
    write_texts(file_, "robot", {run.robot});
    write_texts(file_, "joint_names", run.telemetry.joint_names);
    write_texts(file_, "contact_names", run.telemetry.contact_names);
    write_texts(file_, "modes", run.telemetry.modes);
    write_texts(file_, "faults", run.telemetry.faults);
    std::vector<std::string> phases;
    for (const DescribedPhase& phase : run.telemetry.phases) phases.push_back(phase.name);
    write_texts(file_, "phases", phases);
    write_limits(run.telemetry.torque_limits);
    create_columns();
  }

  void add(const TelemetryFrame& frame) override {
    std::size_t c = 0;
    visit_fields(frame, [&](const FieldText& /*field*/, const auto& member) {
      Column& column = columns_[c++];
      if (column.row_bytes == 0) return;
      const auto* bytes = reinterpret_cast<const char*>(&member);
      column.block.insert(column.block.end(), bytes, bytes + column.row_bytes);
    });
    if (++rows_ % kRows == 0) write_blocks();
  }

  void close() override {
    write_blocks();
    bool good = true;
    for (Column& column : columns_) good = column.set.reset() && good;
    if (!file_.reset() || !good) fail();
  }

 private:
  [[noreturn]] void fail() const { throw InputError(path_.string() + ": cannot write"); }
  void check(herr_t result) const {
    if (result < 0) fail();
  }
  Handle checked(hid_t id, Handle::Close closer) const {
    if (id < 0) fail();
    return {id, closer};
  }

  std::size_t size_of(const PerJoint& /*tag*/) const { return joints_; }
  std::size_t size_of(const PerContact& /*tag*/) const { return contacts_; }
  template <std::size_t N>
  std::size_t size_of(const std::array<double, N>& /*tag*/) const {
    return N;
  }

  void write_texts(const Handle& object, const char* name, const std::vector<std::string>& texts) {
    if (texts.empty()) return;
    const Handle type = checked(H5Tcopy(H5T_C_S1), H5Tclose);
    check(H5Tset_size(type.id(), H5T_VARIABLE));
    check(H5Tset_cset(type.id(), H5T_CSET_UTF8));
    const hsize_t size = texts.size();
    const Handle space = texts.size() == 1 ? checked(H5Screate(H5S_SCALAR), H5Sclose)
                                           : checked(H5Screate_simple(1, &size, nullptr), H5Sclose);
    const Handle attribute = checked(
        H5Acreate2(object.id(), name, type.id(), space.id(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    std::vector<const char*> pointers;
    pointers.reserve(texts.size());
    for (const std::string& text : texts) pointers.push_back(text.c_str());
    check(H5Awrite(attribute.id(), type.id(), pointers.data()));
  }

  void write_limits(const std::vector<double>& limits) {
    if (limits.empty()) return;
    const hsize_t size = limits.size();
    const Handle space = checked(H5Screate_simple(1, &size, nullptr), H5Sclose);
    const Handle attribute = checked(H5Acreate2(file_.id(), "torque_limits", H5T_NATIVE_DOUBLE,
                                                space.id(), H5P_DEFAULT, H5P_DEFAULT),
                                     H5Aclose);
    check(H5Awrite(attribute.id(), H5T_NATIVE_DOUBLE, limits.data()));
  }

  void create_columns() {
    const TelemetryFrame frame;
    visit_fields(frame, [&](const FieldText& field, const auto& member) {
      using Member = std::decay_t<decltype(member)>;
      Column column;
      if constexpr (std::is_arithmetic_v<Member>) {
        column.type = type_of(member);
        column.row_bytes = sizeof member;
      } else {
        column.type = H5T_NATIVE_DOUBLE;
        column.width = size_of(member);
        column.row_bytes = column.width * sizeof(double);
      }
      // A robot without contacts has no data set for their forces.
      if (column.row_bytes != 0) {
        column.set = create_set(field, column);
        column.block.reserve(kRows * column.row_bytes);
      }
      columns_.push_back(std::move(column));
    });
  }

  Handle create_set(const FieldText& field, const Column& column) {
    const int rank = column.width == 0 ? 1 : 2;
    const std::array<hsize_t, 2> none = {0, column.width};
    const std::array<hsize_t, 2> any = {H5S_UNLIMITED, column.width};
    const std::array<hsize_t, 2> block = {kRows, column.width};
    const Handle space = checked(H5Screate_simple(rank, none.data(), any.data()), H5Sclose);
    const Handle settings = checked(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    check(H5Pset_chunk(settings.id(), rank, block.data()));
    check(H5Pset_shuffle(settings.id()));
    check(H5Pset_deflate(settings.id(), 1));
    Handle set = checked(H5Dcreate2(file_.id(), field.name, column.type, space.id(), H5P_DEFAULT,
                                    settings.id(), H5P_DEFAULT),
                         H5Dclose);
    if (*field.unit != '\0') write_texts(set, "unit", {field.unit});
    write_texts(set, "meaning", {field.meaning});
    return set;
  }

  void write_blocks() {
    for (Column& column : columns_)
      if (!column.block.empty()) write_block(column);
  }

  void write_block(Column& column) {
    const int rank = column.width == 0 ? 1 : 2;
    const std::array<hsize_t, 2> count = {column.block.size() / column.row_bytes, column.width};
    const std::array<hsize_t, 2> start = {rows_ - count[0], 0};
    const std::array<hsize_t, 2> size = {rows_, column.width};
    check(H5Dset_extent(column.set.id(), size.data()));
    const Handle memory = checked(H5Screate_simple(rank, count.data(), nullptr), H5Sclose);
    const Handle space = checked(H5Dget_space(column.set.id()), H5Sclose);
    check(H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, start.data(), nullptr, count.data(),
                              nullptr));
    check(H5Dwrite(column.set.id(), column.type, memory.id(), space.id(), H5P_DEFAULT,
                   column.block.data()));
    column.block.clear();
  }

  std::filesystem::path path_;
  std::size_t joints_;
  std::size_t contacts_;
  Handle file_;
  std::vector<Column> columns_;  ///< in the order of visit_fields(); closed before the file
  hsize_t rows_ = 0;
};

}  // namespace

std::unique_ptr<RunFile> open_hdf5(const std::filesystem::path& file, const RunDescription& run) {
  return std::make_unique<Hdf5File>(file, run);
}

}  // namespace clamber
