// CSV and HDF5: every number comes back; the reader of the HDF5 file is its own library.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <charconv>
#include <fstream>
#include <sstream>

#include "recording/run_file.hpp"
#include "robot_model/loader.hpp"
#include "tests/recording/made_run.hpp"

namespace clamber {
namespace {

using test::made_frame;
using test::made_run;
using test::TemporaryFile;
using testing::HasSubstr;

constexpr std::uint64_t kFrames = 1500;  // more than one block of HDF5's, not a multiple

void write(RunFile& file) {
  for (std::uint64_t i = 0; i < kFrames; ++i) file.add(made_frame(i));
  file.close();
}

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> list;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) list.push_back(cell);
  return list;
}

TEST(Csv, KeepsEveryBit) {
  const TemporaryFile file("run.csv");
  write(*open_csv(file.path(), made_run()));
  std::ifstream in(file.path());
  std::string line;
  ASSERT_TRUE(std::getline(in, line));
  const std::vector<std::string> names = cells(line);
  EXPECT_EQ(names.size(), 9U + 9 * test::kJoints + 3 + 4 + 2 * test::kContacts + 2);
  const auto column = static_cast<std::size_t>(
      std::find(names.begin(), names.end(), "tau_meas.Joint22 [N m]") - names.begin());
  ASSERT_LT(column, names.size());
  std::uint64_t tick = 0;
  for (; std::getline(in, line); ++tick) {
    const std::vector<std::string> row = cells(line);
    ASSERT_EQ(row.size(), names.size());
    double torque = 0.0;
    const std::string& cell = row[column];
    std::from_chars(cell.data(), cell.data() + cell.size(), torque);
    ASSERT_EQ(torque, made_frame(tick).tau_meas[22]);
    ASSERT_EQ(row[0], std::to_string(tick));
  }
  EXPECT_EQ(tick, kFrames);
}

TEST(Hdf5, KeepsEveryBit) {
  const TemporaryFile file("run.h5");
  write(*open_hdf5(file.path(), made_run()));
  const hid_t h5 = H5Fopen(file.path().c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  ASSERT_GE(h5, 0);
  const hid_t set = H5Dopen2(h5, "tau_meas", H5P_DEFAULT);
  const hid_t space = H5Dget_space(set);
  hsize_t size[2] = {};
  ASSERT_EQ(H5Sget_simple_extent_dims(space, size, nullptr), 2);
  ASSERT_EQ(size[0], kFrames);
  ASSERT_EQ(size[1], static_cast<hsize_t>(test::kJoints));
  std::vector<double> torques(kFrames * test::kJoints);
  ASSERT_GE(H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, torques.data()), 0);
  for (std::uint64_t i = 0; i < kFrames; ++i)
    ASSERT_EQ(torques[i * test::kJoints + 22], made_frame(i).tau_meas[22]) << i;
  H5Sclose(space);
  H5Dclose(set);

  const hid_t phase = H5Dopen2(h5, "phase", H5P_DEFAULT);
  std::vector<std::uint32_t> phases(kFrames);
  ASSERT_GE(H5Dread(phase, H5T_NATIVE_UINT32, H5S_ALL, H5S_ALL, H5P_DEFAULT, phases.data()), 0);
  EXPECT_EQ(phases.back(), 1U);
  H5Dclose(phase);

  const hid_t names = H5Aopen(h5, "joint_names", H5P_DEFAULT);
  const hid_t type = H5Aget_type(names);
  std::vector<char*> texts(test::kJoints);
  ASSERT_GE(H5Aread(names, type, texts.data()), 0);
  EXPECT_STREQ(texts.back(), "Joint22");
  const hid_t names_space = H5Aget_space(names);
  H5Dvlen_reclaim(type, names_space, H5P_DEFAULT, texts.data());
  H5Sclose(names_space);
  H5Tclose(type);
  H5Aclose(names);
  H5Fclose(h5);
}

TEST(Tables, SayWhereTheyCannotBeWritten) {
  EXPECT_THROW(static_cast<void>(open_csv("/nowhere/run.csv", made_run())), InputError);
  EXPECT_THROW(static_cast<void>(open_hdf5("/nowhere/run.h5", made_run())), InputError);
}

}  // namespace
}  // namespace clamber
