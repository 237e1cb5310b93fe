// Writes a made-up motion as MVNX version 4. Tools only; allocates; never blocks.
#pragma once

#include <string>
#include <vector>

#include "tools/human_figure.hpp"

namespace clamber::tools {

/// The document, marked SYNTHETIC in its header, comments and file name fields: segments with
/// their points, joints, the three special frames, then one normal frame per figure with
/// orientation, position, jointAngle and footContacts. Same figures, same bytes.
[[nodiscard]] std::string write_mvnx(const Skeleton& skeleton, const std::vector<Figure>& figures,
                                     int rate, const std::string& description);

}  // namespace clamber::tools
