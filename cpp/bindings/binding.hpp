// The only header that includes pybind11. Bindings translate; they hold no logic.
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "exactarm/robot/robot.hpp"

namespace exactarm::bindings {

namespace py = pybind11;

// Lets other Python threads run while the core works, as pybind11's gil_scoped_release does. A thread that
// wants to go back to an interpreter which is ending waits for that end: Python would unwind it through C++
// (as of 3.14 it waits, too).
class ReleasedGil {
 public:
  ReleasedGil() : state_(PyEval_SaveThread()) {}
  ~ReleasedGil();
  ReleasedGil(const ReleasedGil&) = delete;
  ReleasedGil& operator=(const ReleasedGil&) = delete;

 private:
  PyThreadState* state_;
};

// Doubles of any shape, C-contiguous; others are copied.
using Values = py::array_t<double, py::array::c_style | py::array::forcecast>;

// New C-contiguous array of doubles.
template <class... Sizes>
py::array_t<double> new_array(Sizes... sizes) {
  return py::array_t<double>(std::vector<py::ssize_t>{static_cast<py::ssize_t>(sizes)...});
}

void bind_interrupt(py::module_& module);
void bind_robot(py::module_& module);
void bind_kinematics(py::module_& module);
void bind_dynamics(py::module_& module);
void bind_dynamics_derivatives(py::module_& module);
void bind_elastic_joint_dynamics(py::module_& module);
void bind_regressor(py::module_& module);
void bind_gear(py::module_& module);
void bind_harmonics(py::module_& module);
void bind_gear_profile(py::module_& module);
void bind_signals(py::module_& module);
void bind_blocks(py::module_& module);
void bind_inverse_kinematics(py::module_& module);
void bind_solution(py::module_& module);

}  // namespace exactarm::bindings
