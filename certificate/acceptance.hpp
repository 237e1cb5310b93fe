// What a plan must keep to be certified, and the uncertainty it is certified for.
// Start-up only: the reader allocates, reads a file and throws InputError.
#pragma once

#include <filesystem>

#include "certificate/measure.hpp"

namespace clamber {

/// Least slack or largest error of every quantity, gaps between samples included.
/// configs/certificate/default.yaml gives the reason of each.
struct Acceptance {
  Uncertainty uncertainty;
  QuantityValues limit;
  double at_samples_moment = 1e-6;  ///< N m, residual at the samples themselves
  double stored_tolerance = 1e-7;   ///< SI unit, stored number against recomputed one

  Acceptance();
  friend bool operator==(const Acceptance& a, const Acceptance& b);
};

/// @throws InputError
[[nodiscard]] Acceptance load_acceptance(const std::filesystem::path& file);

}  // namespace clamber
