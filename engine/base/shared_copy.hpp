// A value that its copies share until one of them changes it.
#pragma once

#include <atomic>
#include <memory>
#include <utility>

namespace asterism {

template <typename Value>
class SharedCopy {
 public:
  SharedCopy() = default;
  explicit SharedCopy(Value value) : value_(std::make_shared<Value>(std::move(value))) {}

  bool has_value() const { return value_ != nullptr; }
  const Value* operator->() const { return value_.get(); }
  // To be changed: from here on this copy's own.
  Value& own() {
    if (value_.use_count() > 1) value_ = std::make_shared<Value>(std::as_const(*value_));
    // Whoever gave it up last has read it to the end.
    std::atomic_thread_fence(std::memory_order_acquire);
    return *value_;
  }

 private:
  std::shared_ptr<Value> value_;
};

}  // namespace asterism
