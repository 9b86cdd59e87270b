// Limits on the length of chains: a number of moves, a deadline, and cancellation by the caller.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <thread>
#include <utility>
#include <vector>

#include "mcmc/chain/split.hpp"

namespace asterism {

using Clock = std::chrono::steady_clock;

// The time so many seconds after `start`; the maximum if the clock cannot represent it.
inline Clock::time_point after(Clock::time_point start, double seconds) {
  constexpr double kMaxSeconds = 1e9;
  if (!(seconds < kMaxSeconds)) return Clock::time_point::max();
  return start + std::chrono::duration_cast<Clock::duration>(
                     std::chrono::duration<double>(std::max(seconds, 0.0)));
}

// Regularly calls a callback with the fraction of the work done, on the thread that created the
// object. The callback returns whether to continue.
class Watch {
 public:
  Watch(double all, std::function<bool(double)> goes_on)
      : all_(all), goes_on_(std::move(goes_on)), owner_(std::this_thread::get_id()) {}

  // Counts moves that are about to be made.
  bool is_stopped_before(std::int64_t n_more) {
    n_done_ += n_more;
    if (std::this_thread::get_id() == owner_ && Clock::now() > next_) {
      next_ = Clock::now() + std::chrono::milliseconds(100);
      const auto done = static_cast<double>(n_done_);
      if (!goes_on_(done < all_ ? done / all_ : 1.0)) is_stopped_ = true;
    }
    return is_stopped_;
  }
  bool is_stopped() const { return is_stopped_; }

 private:
  double all_;
  std::function<bool(double)> goes_on_;
  std::thread::id owner_;
  Clock::time_point next_ = Clock::now();
  std::atomic<std::int64_t> n_done_ = 0;
  std::atomic<bool> is_stopped_ = false;
};

struct Budget {
  std::int64_t moves = 0;
  Clock::time_point until = Clock::time_point::max();
  Watch* watch = nullptr;
  static constexpr std::int64_t kLookEvery = 256;

  // The first part of the budget, without its watch. Its time counts from `start`.
  Budget first(double share, Clock::time_point start) const {
    Budget out{static_cast<std::int64_t>(std::llround(share * static_cast<double>(moves))), until};
    if (until != Clock::time_point::max() && share < 1)
      out.until = start + std::chrono::duration_cast<Clock::duration>(share * (until - start));
    return out;
  }
  bool is_over(std::int64_t n) const {
    if (n >= moves) return true;
    if (n % 16 != 0) return false;
    if (until != Clock::time_point::max() && Clock::now() > until) return true;
    return watch != nullptr && n % kLookEvery == 0 &&
           watch->is_stopped_before(std::min(kLookEvery, moves - n));
  }
};

// The budgets of groups, proportional to their weights.
class Budgets {
 public:
  // `moves` is per unit of weight.
  Budgets(std::span<const double> weights, double moves, Watch* watch = nullptr) : watch_(watch) {
    for (const double weight : weights) {
      const double own = weight > 0 ? std::ceil(moves * weight) : 0;  // moves may be infinite
      moves_.push_back(own < static_cast<double>(kEndless) ? static_cast<std::int64_t>(own) : kEndless);
    }
  }
  // Also divides the time until `end` among the chains of all groups.
  void end_at(Clock::time_point end, std::span<const double> weights, std::int32_t n_chains,
              std::int32_t n_threads) {
    end_ = end;
    double all = 0;
    for (const double weight : weights) all += weight * n_chains;
    const double left = std::chrono::duration<double>(end - Clock::now()).count();
    const double workers = std::min<double>(n_threads, static_cast<double>(weights.size()) * n_chains);
    for (const double weight : weights)
      seconds_.push_back(weight > 0 ? left * workers * weight / all : 0);
  }

  // Returns the budget of a group, whose time starts now.
  Budget of(std::size_t group) const {
    Budget out{moves_[group], end_, watch_};
    if (!seconds_.empty()) out.until = std::min(end_, after(Clock::now(), seconds_[group]));
    return out;
  }

 private:
  static constexpr std::int64_t kEndless = std::int64_t{1} << 50;

  std::vector<std::int64_t> moves_;
  std::vector<double> seconds_;
  Clock::time_point end_ = Clock::time_point::max();
  Watch* watch_;
};

}  // namespace asterism
