// Position-only recordings made from the synthetic climb, and a two-bone Acclaim skeleton.
#pragma once

#include <cstring>
#include <map>
#include <string>

#include "planner_offline/recording/npy.hpp"
#include "tools/climb_choreography.hpp"

namespace clamber {

/// Which joint of the made-up person stands for which recorded point.
inline const std::map<std::string, int>& point_sources() {
  using namespace tools;
  static const std::map<std::string, int> sources{{"Hips", kPelvis},
                                                  {"Spine", kL5},
                                                  {"Spine1", kT8},
                                                  {"Neck", kNeck},
                                                  {"RightArm", kRightUpperArm},
                                                  {"RightForeArm", kRightForeArm},
                                                  {"RightHand", kRightHand},
                                                  {"RightUpLeg", kRightUpperLeg},
                                                  {"RightLeg", kRightLowerLeg},
                                                  {"RightFoot", kRightFoot},
                                                  {"RightToeBase", kRightToe},
                                                  {"LeftArm", kLeftUpperArm},
                                                  {"LeftForeArm", kLeftForeArm},
                                                  {"LeftHand", kLeftHand},
                                                  {"LeftUpLeg", kLeftUpperLeg},
                                                  {"LeftLeg", kLeftLowerLeg},
                                                  {"LeftFoot", kLeftFoot},
                                                  {"LeftToeBase", kLeftToe}};
  return sources;
}

/// The made-up climb's joint positions as a .npy file of `frames` frames, `rate` a second.
inline std::string make_npy(int frames, const std::string& type, double rate = 1.0) {
  std::string header = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (" +
                       std::to_string(frames) + ", 53, 3), }";
  header.resize(118, ' ');
  header.back() = '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += std::string("\x76\x00", 2) + header;
  const tools::ClimbChoreography climb({});
  for (int f = 0; f < frames; ++f) {
    const auto figure = climb.at(f / rate);
    for (const auto& label : npy_joint_labels()) {
      const auto source = point_sources().find(label);
      for (int k = 0; k < 3; ++k) {
        const double value = source == point_sources().end()
                                 ? 0.0
                                 : figure.p[static_cast<std::size_t>(source->second)][k];
        const auto single = static_cast<float>(value);
        char raw[8];
        std::memcpy(raw, type == "<f4" ? static_cast<const void*>(&single) : &value,
                    type == "<f4" ? 4 : 8);
        bytes.append(raw, type == "<f4" ? 4 : 8);
      }
    }
  }
  return bytes;
}

inline std::string small_asf() {
  return ":version 1.10\n:name T\n:units\n  mass 1.0\n  length 0.45\n  angle deg\n"
         ":root\n  order TX TY TZ RX RY RZ\n  axis XYZ\n  position 0 0 0\n  orientation 0 0 0\n"
         ":bonedata\n"
         "  begin\n    id 1\n    name a\n    direction 0 1 0\n    length 2\n    axis 0 0 20 XYZ\n"
         "    dof rx ry rz\n    limits (-1 1)\n           (-1 1)\n           (-1 1)\n  end\n"
         "  begin\n    id 2\n    name b\n    direction 1 0 0\n    length 1\n    axis 0 0 0 XYZ\n"
         "  end\n"
         ":hierarchy\n  begin\n    root a\n    a b\n  end\n";
}

}  // namespace clamber
