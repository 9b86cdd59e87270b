// Packing by a function of Python's.
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

// A Python function that chooses: (first option of each tree, worths, first use of each option, uses,
// first resource of each frame) to (option of each tree, bound of the sum of worths). Trackers are
// copied and dropped without the GIL, so the function is held once and let go with it.
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
    std::size_t n_options = 0, n_uses = 0;
    for (const auto& options : trees)
      for (const PackingOption& option : options) {
        ++n_options;
        n_uses += option.uses.size();
      }
    nb::gil_scoped_acquire acquire;
    Owned<std::int64_t> first_option(trees.size() + 1), first_use(n_options + 1);
    Owned<double> worths(n_options);
    Owned<std::int32_t> uses(n_uses), resources(first_resource.size());
    std::copy(first_resource.begin(), first_resource.end(), resources.data.get());
    std::size_t o = 0, u = 0;
    for (std::size_t i = 0; i < trees.size(); ++i) {
      for (const PackingOption& option : trees[i]) {
        worths.data[o] = option.worth;
        for (const std::int32_t r : option.uses) uses.data[u++] = r;
        first_use.data[++o] = static_cast<std::int64_t>(u);
      }
      first_option.data[i + 1] = static_cast<std::int64_t>(o);
    }
    const nb::tuple out = nb::cast<nb::tuple>(
        choose_(first_option.give({trees.size() + 1}), worths.give({n_options}),
                first_use.give({n_options + 1}), uses.give({n_uses}),
                resources.give({first_resource.size()})));
    const auto own = nb::cast<In<std::int32_t>>(out[0]);
    require(own.size() == trees.size(), "an option for every tree");
    double value = 0;
    for (std::size_t i = 0; i < trees.size(); ++i) {
      const std::int32_t k = own.data()[i];
      require(k >= 0 && k < static_cast<std::int32_t>(trees[i].size()), "options of the trees");
      value += trees[i][k].worth;
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
