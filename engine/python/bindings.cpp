// The compiled module. Only the bind_* files know Python: they check shapes, release the GIL and turn
// statuses into exceptions. The Python face has checked values already; what they check keeps memory
// safe.
#include "python/bindings.hpp"

namespace nb = nanobind;

NB_MODULE(_engine, module) {
  nb::set_leak_warnings(false);  // what is alive at exit is nobody's loss
  bind_tracking(module);
  bind_likelihood(module);
  bind_options(module);
  bind_frame(module);
  bind_trees(module);
  bind_mcmc(module);
  bind_camera(module);
  bind_solvers(module);
  bind_chain(module);
  bind_stitcher(module);
  bind_reconstruct(module);
}
