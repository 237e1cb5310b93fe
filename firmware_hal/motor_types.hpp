// Motor types from configs/hal/motors.yaml. Start-up only: allocates, reads files, throws.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "firmware_hal/bus_map.hpp"
#include "robot_model/yaml_reader.hpp"

namespace clamber {

struct ListedMotor {
  MotorType type;
  std::string where;  ///< file, line, key: for complaints about it
};

/// @throws InputError
[[nodiscard]] std::map<std::string, ListedMotor> load_motor_types(
    const std::filesystem::path& file);

/// mit or cia402. @throws InputError
[[nodiscard]] BusProtocol read_protocol(const YamlNode& node);

}  // namespace clamber
