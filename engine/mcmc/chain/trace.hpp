// The log posterior along a chain: mean, variance, and effective sample size from batch means.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

namespace asterism {

class Trace {
 public:
  void begin(std::int64_t n) {
    batch_ = std::max<std::int64_t>(n / kBatches, 1);
    n_ = in_batch_ = 0;
    sum_ = sum2_ = batch_sum_ = 0;
  }
  void add(double x) {
    ++n_;
    sum_ += x;
    sum2_ += x * x;
    batch_sum_ += x;
    if (++in_batch_ < batch_) return;
    means_.push_back(batch_sum_ / static_cast<double>(batch_));
    batch_sum_ = 0;
    in_batch_ = 0;
  }
  double mean() const { return sum_ / static_cast<double>(n_); }
  double variance() const {
    return std::max(sum2_ / static_cast<double>(n_) - mean() * mean(), 0.0);
  }
  // NaN if the chain never moved.
  double ess_of_halves(std::int64_t n) const {
    double mean = 0, between = 0;
    for (const double x : means_) mean += x / static_cast<double>(means_.size());
    for (const double x : means_) between += (x - mean) * (x - mean);
    between /= std::max<double>(static_cast<double>(means_.size()) - 1, 1);
    const double all = variance();
    if (!(between > 0) || !(all > 0)) return std::numeric_limits<double>::quiet_NaN();
    return std::min(static_cast<double>(n),
                    static_cast<double>(n) * all / (static_cast<double>(batch_) * between));
  }

 private:
  static constexpr std::int64_t kBatches = 10;
  std::vector<double> means_;
  std::int64_t batch_ = 1, n_ = 0, in_batch_ = 0;
  double sum_ = 0, sum2_ = 0, batch_sum_ = 0;
};

}  // namespace asterism
