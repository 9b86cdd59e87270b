// The compiled module. Only the bind_* files know Python: they check shapes, release the GIL and turn
// statuses into exceptions. The Python face has checked values already; what they check keeps memory
// safe.
#include "bindings.hpp"

NB_MODULE(_engine, module) {
  bind_tracking(module);
  bind_camera(module);
}
