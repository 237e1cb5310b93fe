// Growing storage behind Eigen maps: sizes may change from call to call, memory only ever grows.
// Any thread (not shared); allocates: only when a size is larger than all before; blocks: never.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace clamber {

using MatrixMap = Eigen::Map<Eigen::MatrixXd>;
using VectorMap = Eigen::Map<Eigen::VectorXd>;

/// Memory for one matrix or vector whose size varies between the levels of a hierarchy.
class Workspace {
 public:
  [[nodiscard]] MatrixMap matrix(Eigen::Index rows, Eigen::Index cols) {
    reserve(rows * cols);
    return {storage_.data(), rows, cols};
  }
  [[nodiscard]] VectorMap vector(Eigen::Index size) {
    reserve(size);
    return {storage_.data(), size};
  }

 private:
  void reserve(Eigen::Index size) {
    const auto wanted = static_cast<std::size_t>(size);
    if (storage_.size() < wanted) storage_.resize(wanted);
  }
  std::vector<double> storage_;
};

}  // namespace clamber
