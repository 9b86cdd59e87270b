// The functions by which each binding file adds its part to the module.
#pragma once

#include <nanobind/nanobind.h>

void bind_tracking(nanobind::module_& module);
void bind_likelihood(nanobind::module_& module);
void bind_options(nanobind::module_& module);
void bind_trees(nanobind::module_& module);
void bind_mcmc(nanobind::module_& module);
void bind_frame(nanobind::module_& module);
void bind_camera(nanobind::module_& module);
void bind_solvers(nanobind::module_& module);
void bind_chain(nanobind::module_& module);
void bind_rigid(nanobind::module_& module);
void bind_shared(nanobind::module_& module);
void bind_stitcher(nanobind::module_& module);
void bind_reconstruct(nanobind::module_& module);
void bind_naming(nanobind::module_& module);
void bind_name_windows(nanobind::module_& module);
void bind_confidence(nanobind::module_& module);
void bind_large(nanobind::module_& module);
