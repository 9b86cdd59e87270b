// A packing solver that is implemented by a Python function.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "solve/set_packing.hpp"
#include "tracks/live_tracks.hpp"

namespace asterism {

// The function maps (first option of each tree, weights, first use of each option, uses, first
// resource of each frame) to (option of each tree, bound of the total weight). Trackers are copied
// and destroyed without the GIL, so the function is held by one shared object that acquires it.
class PythonPacker {
 public:
  explicit PythonPacker(nb::object choose) : choose_(std::move(choose)) {}
  PythonPacker(const PythonPacker&) = delete;
  PythonPacker& operator=(const PythonPacker&) = delete;
  ~PythonPacker() {
    nb::gil_scoped_acquire acquire;
    choose_.reset();
  }

  std::vector<std::int32_t> operator()(std::span<const std::vector<PackingOption>> trees,
                                       std::span<const std::int32_t> first_resource,
                                       TreeStats& stats) const {
    std::vector<std::size_t> first_option{0}, first_use{0};
    std::vector<double> log_weights;
    std::vector<std::int32_t> uses;
    for (const auto& options : trees) {
      for (const PackingOption& option : options) {
        log_weights.push_back(option.log_weight);
        uses.insert(uses.end(), option.uses.begin(), option.uses.end());
        first_use.push_back(uses.size());
      }
      first_option.push_back(log_weights.size());
    }
    nb::gil_scoped_acquire acquire;
    const nb::tuple out = nb::cast<nb::tuple>(
        choose_(array_of<std::int64_t>(first_option), array_of<double>(log_weights),
                array_of<std::int64_t>(first_use), array_of<std::int32_t>(uses),
                array_of<std::int32_t>(first_resource)));
    const auto own = nb::cast<In<std::int32_t>>(out[0]);
    require(own.size() == trees.size(), "an option for every tree");
    double value = 0;
    for (std::size_t i = 0; i < trees.size(); ++i) {
      const std::int32_t k = own.data()[i];
      require(k >= 0 && k < static_cast<std::int32_t>(trees[i].size()), "options of the trees");
      value += trees[i][k].log_weight;
    }
    const double gap = nb::cast<double>(out[1]) - value;
    stats.gap = std::max(stats.gap, gap > 1e-6 ? gap : 0.0);
    stats.n_beams += gap > 1e-6;
    return {own.data(), own.data() + own.size()};
  }

 private:
  nb::object choose_;
};

}  // namespace asterism
