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
    summary = JointEvents({log_weights.data(), n * m}, {log_miss.data(), n}, max_states,
                          {marginals.data.get(), n * (m + 1)}, {best.data.get(), n})
                  .solve();
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
