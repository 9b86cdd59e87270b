// Working memory that an object keeps between steps. Copying the object does not copy the memory,
// which is then empty in the copy.
#pragma once

namespace asterism {

template <typename Memory>
struct Scratch : Memory {
  Scratch() = default;
  Scratch(const Scratch&) : Memory() {}
  Scratch& operator=(const Scratch&) { return *this; }
};

}  // namespace asterism
