// A copy-on-write value: copies share it until one of them changes it.
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
  const Value& operator*() const { return *value_; }
  // Returns a reference that may be written. A shared value is cloned first.
  Value& own() {
    if (value_.use_count() > 1) value_ = std::make_shared<Value>(std::as_const(*value_));
    // Orders the reads of the copy that last released the value before the writes of this one.
    std::atomic_thread_fence(std::memory_order_acquire);
    return *value_;
  }

 private:
  std::shared_ptr<Value> value_;
};

}  // namespace asterism
