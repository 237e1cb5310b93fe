#include "firmware_hal/virtual_drives/object_dictionary.hpp"

#include <algorithm>

namespace clamber {
namespace {

std::uint32_t key(std::uint16_t index, std::uint8_t sub) noexcept {
  return std::uint32_t{index} << 8 | sub;
}

bool before(const ObjectDictionary::Object& object, std::uint32_t wanted) noexcept {
  return key(object.index, object.sub) < wanted;
}

std::uint32_t mask(std::uint8_t size) noexcept {
  return size >= 4 ? 0xFFFFFFFFu : (1u << (8u * size)) - 1u;
}

}  // namespace

void ObjectDictionary::define(std::uint16_t index, std::uint8_t sub, std::uint8_t size,
                              std::uint32_t value, bool read_only) {
  const Object object{index, sub, size, read_only, value & mask(size), value & mask(size)};
  const auto at = std::lower_bound(objects_.begin(), objects_.end(), key(index, sub), before);
  if (at != objects_.end() && at->index == index && at->sub == sub)
    *at = object;
  else
    objects_.insert(at, object);
}

ObjectDictionary::Object* ObjectDictionary::find(std::uint16_t index, std::uint8_t sub) noexcept {
  const auto at = std::lower_bound(objects_.begin(), objects_.end(), key(index, sub), before);
  return at != objects_.end() && at->index == index && at->sub == sub ? &*at : nullptr;
}

bool ObjectDictionary::has_index(std::uint16_t index) const noexcept {
  const auto at = std::lower_bound(objects_.begin(), objects_.end(), key(index, 0), before);
  return at != objects_.end() && at->index == index;
}

std::uint32_t ObjectDictionary::value(std::uint16_t index, std::uint8_t sub) noexcept {
  const Object* object = find(index, sub);
  return object == nullptr ? 0 : object->value;
}

void ObjectDictionary::set(std::uint16_t index, std::uint8_t sub, std::uint32_t value) noexcept {
  if (Object* object = find(index, sub)) object->value = value & mask(object->size);
}

void ObjectDictionary::restore(std::uint16_t first, std::uint16_t last) noexcept {
  for (Object& object : objects_)
    if (object.index >= first && object.index <= last) object.value = object.initial;
}

std::uint32_t ObjectDictionary::refusal(const Sdo& sdo) noexcept {
  if (sdo.kind != SdoKind::kDownload && sdo.kind != SdoKind::kUpload) return kSdoAbortCommand;
  const Object* object = find(sdo.index, sdo.sub);
  if (object == nullptr)
    return has_index(sdo.index) ? std::uint32_t{kSdoAbortNoSubIndex} : kSdoAbortNoObject;
  if (sdo.kind == SdoKind::kUpload) return 0;
  if (object->read_only) return kSdoAbortReadOnly;
  const bool fits = sdo.size == 0 || sdo.size == object->size;
  return fits ? 0u : std::uint32_t{kSdoAbortLength};
}

}  // namespace clamber
