// Runs independent tasks on several threads. The result of a task must not depend on the thread
// that runs it or on the order.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <limits>
#include <system_error>
#include <thread>
#include <vector>

namespace asterism {

// Calls task(worker, k) for every k below n; workers are numbered from 0. After a task throws, no
// further task starts. The exception of the failed task with the smallest k is thrown again here.
template <typename Task>
void in_parallel(std::int64_t n, std::int32_t n_threads, Task&& task) {
  const auto n_workers = static_cast<std::int32_t>(std::min<std::int64_t>(n, n_threads));
  if (n_workers <= 1) {
    for (std::int64_t k = 0; k < n; ++k) task(0, k);
    return;
  }
  struct Failure {
    std::int64_t task = std::numeric_limits<std::int64_t>::max();
    std::exception_ptr exception;
  };
  std::vector<Failure> failures(n_workers);
  std::atomic<std::int64_t> next = 0;
  const auto work = [&](std::int32_t worker) {
    for (std::int64_t k = next++; k < n; k = next++) {
      try {
        task(worker, k);
      } catch (...) {
        failures[worker] = {k, std::current_exception()};
        next = n;
      }
    }
  };
  {
    std::vector<std::jthread> others;  // joined at the end of the block, also on an exception
    try {
      for (std::int32_t worker = 1; worker < n_workers; ++worker) others.emplace_back(work, worker);
    } catch (const std::system_error&) {
      // The system has no more threads, so the threads already started do the work.
    }
    work(0);
  }
  const auto first = std::ranges::min_element(failures, {}, &Failure::task);
  if (first->exception) std::rethrow_exception(first->exception);
}

}  // namespace asterism
