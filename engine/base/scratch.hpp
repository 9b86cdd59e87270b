// Working memory that is kept from step to step: whoever is copied, the copy begins with none.
#pragma once

namespace asterism {

template <typename Memory>
struct Fresh : Memory {
  Fresh() = default;
  Fresh(const Fresh&) : Memory() {}
  Fresh& operator=(const Fresh&) { return *this; }
};

}  // namespace asterism
