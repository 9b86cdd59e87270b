// Independent tasks on several threads. What a task does may not depend on who does it, or when.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

namespace asterism {

// Calls task(worker, k) for every k below n; workers are numbered from 0.
template <typename Task>
void in_parallel(std::int64_t n, std::int32_t n_threads, Task&& task) {
  const auto n_workers = static_cast<std::int32_t>(std::min<std::int64_t>(n, n_threads));
  if (n_workers <= 1) {
    for (std::int64_t k = 0; k < n; ++k) task(0, k);
    return;
  }
  std::atomic<std::int64_t> next = 0;
  const auto work = [&](std::int32_t worker) {
    for (std::int64_t k = next++; k < n; k = next++) task(worker, k);
  };
  std::vector<std::thread> others;
  for (std::int32_t worker = 1; worker < n_workers; ++worker) others.emplace_back(work, worker);
  work(0);
  for (std::thread& other : others) other.join();
}

}  // namespace asterism
