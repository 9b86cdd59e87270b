// The compiled module. Only the bind_* files depend on Python: they check shapes, release the GIL
// and turn status values into exceptions. The Python layer has validated the values already; the
// checks here protect memory.
#include "python/bindings.hpp"

namespace nb = nanobind;

NB_MODULE(_engine, module) {
  nb::set_leak_warnings(false);  // objects alive at exit are no leak
  bind_tracking(module);
  bind_likelihood(module);
  bind_options(module);
  bind_frame(module);
  bind_trees(module);
  bind_mcmc(module);
  bind_camera(module);
  bind_solvers(module);
  bind_chain(module);
  bind_rigid(module);
  bind_shared(module);
  bind_stitcher(module);
  bind_reconstruct(module);
  bind_naming(module);
  bind_name_windows(module);
  bind_confidence(module);
  bind_large(module);
}
