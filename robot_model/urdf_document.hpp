// Parses a URDF text into urdfdom's tree and checks that it is one tree.
// Any thread but not two at once (the parser's log hook is global); allocates: yes; blocks: no.
#pragma once

#include <urdf_model/model.h>
#include <urdf_world/types.h>

#include <string>

namespace clamber {

/// @param file named in messages only
/// @throws InputError for bad XML, missing or repeated names, missing limits, malformed numbers,
///         several roots, a link with two parents, links that the root does not reach
[[nodiscard]] urdf::ModelInterfaceSharedPtr parse_urdf_document(const std::string& text,
                                                                const std::string& file);

}  // namespace clamber
