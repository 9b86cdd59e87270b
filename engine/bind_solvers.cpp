// The solvers on plain arrays, as Python sees them.
#include <nanobind/stl/tuple.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "joint_events.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

// (marginals with the miss last, log of the total weight, best event, bound, most states).
nb::tuple joint_marginals(const In<double>& log_weights, const In<double>& log_miss,
                          std::int64_t max_states) {
  require(log_weights.ndim() == 2 && log_miss.ndim() == 1 &&
              log_weights.shape(0) == log_miss.shape(0),
          "log_weights: shape (n, m), log_miss: shape (n,)");
  constexpr std::size_t most = std::size_t{1} << 30;
  require(log_weights.shape(0) < most && log_weights.shape(1) < most, "sizes below 2^30");
  require(max_states >= 1 && max_states <= std::int64_t{1} << 30, "max_states: 1 to 2^30");
  const std::size_t n = log_weights.shape(0), m = log_weights.shape(1);
  Owned<double> marginals(n * (m + 1));
  Owned<std::int32_t> best(n);
  JointSummary summary;
  {
    nb::gil_scoped_release release;
    std::vector<Candidate> pairings;
    std::vector<double> weights;
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < m; ++j) {
        const double w = log_weights.data()[i * m + j];
        if (!(w > -std::numeric_limits<double>::infinity())) continue;
        pairings.push_back({static_cast<std::int32_t>(i), static_cast<std::int32_t>(j),
                            w - log_miss.data()[i], 0});
        weights.push_back(w);
      }
    std::vector<double> paired(pairings.size()), missed(n);
    summary = JointEvents(pairings, weights, {log_miss.data(), n}, static_cast<std::int32_t>(m),
                          max_states)
                  .solve(paired, missed, {best.data.get(), n});
    for (std::size_t e = 0; e < pairings.size(); ++e)
      marginals.data[pairings[e].row * (m + 1) + pairings[e].column] = paired[e];
    for (std::size_t i = 0; i < n; ++i) marginals.data[i * (m + 1) + m] = missed[i];
  }
  return nb::make_tuple(marginals.give({n, m + 1}), summary.log_total, best.give({n}),
                        summary.bound, summary.n_states);
}

}  // namespace

void bind_solvers(nb::module_& module) {
  module.def("joint_marginals", &joint_marginals, "log_weights"_a, "log_miss"_a, "max_states"_a);

  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const FrontierLimit& limit) {
      PyErr_SetString(PyExc_OverflowError, limit.what());
    }
  });
}
