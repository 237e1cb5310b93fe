// The inputs are usable and the job did not succeed with them: exit code 1.
#pragma once

#include <stdexcept>

namespace clamber {

class JobFailed : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace clamber
