// Working memory that an object keeps between steps. Copying the object does not copy the memory,
// which is then empty in the copy.
#pragma once

namespace asterism {

template <typename Memory>
struct Fresh : Memory {
  Fresh() = default;
  Fresh(const Fresh&) : Memory() {}
  Fresh& operator=(const Fresh&) { return *this; }
};

}  // namespace asterism
