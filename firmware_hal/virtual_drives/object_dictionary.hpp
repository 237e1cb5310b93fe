// A CANopen object dictionary: numbers of 1 to 4 bytes by index and sub-index.
// One thread; allocates: only define(); blocks: never.
#pragma once

#include <cstdint>
#include <vector>

#include "firmware_hal/codec/canopen.hpp"

namespace clamber {

class ObjectDictionary {
 public:
  struct Object {
    std::uint16_t index = 0;
    std::uint8_t sub = 0;
    std::uint8_t size = 0;  ///< bytes
    bool read_only = false;
    std::uint32_t value = 0;
    std::uint32_t initial = 0;
  };

  /// Adds an object; the last definition of the same counts.
  void define(std::uint16_t index, std::uint8_t sub, std::uint8_t size, std::uint32_t value,
              bool read_only = false);
  [[nodiscard]] Object* find(std::uint16_t index, std::uint8_t sub) noexcept;
  [[nodiscard]] bool has_index(std::uint16_t index) const noexcept;
  /// Of an object that is there; else 0.
  [[nodiscard]] std::uint32_t value(std::uint16_t index, std::uint8_t sub = 0) noexcept;
  void set(std::uint16_t index, std::uint8_t sub, std::uint32_t value) noexcept;
  /// Values of indices `first` to `last` as they were defined.
  void restore(std::uint16_t first, std::uint16_t last) noexcept;

  /// Why an SDO transfer must be aborted; 0: it need not.
  [[nodiscard]] std::uint32_t refusal(const Sdo& sdo) noexcept;

 private:
  std::vector<Object> objects_;  ///< sorted
};

}  // namespace clamber
