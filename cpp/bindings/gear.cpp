#include "exactarm/robot/gear.hpp"

#include "binding.hpp"
#include "exactarm/base/interrupt.hpp"
#include "exactarm/robot/harmonics.hpp"

namespace exactarm::bindings {
namespace {


constexpr py::ssize_t kAnglesBetweenChecks = 4096;  // for a signal

template <class Function>
py::array_t<double> each(const Values& angles, const Function& function) {
  py::array_t<double> out(std::vector<py::ssize_t>(angles.shape(), angles.shape() + angles.ndim()));
  const double* in = angles.data();
  double* result = out.mutable_data();
  const py::ssize_t size = angles.size();
  const ReleasedGil released;
  for (py::ssize_t i = 0; i < size; ++i) {
    if (i % kAnglesBetweenChecks == 0) check_interrupt();
    result[i] = function(in[i]);
  }
  return out;
}

}  // namespace

void bind_gear(py::module_& module) {
  module.def(
      "gear_motor_angle",
      [](double ratio, const GearTable& table, const Values& phi) {
        return each(phi, [&](double angle) { return gear_motor_angle(ratio, table, angle); });
      },
      py::arg("ratio"), py::arg("table"), py::arg("phi"),
      "Xi(phi): motor angle of each output angle, any shape.");
  module.def(
      "gear_output_angle",
      [](double ratio, const GearTable& table, const Values& theta) {
        require_gear("gear", ratio, table);
        return each(theta, [&](double angle) { return gear_output_angle(ratio, table, angle); });
      },
      py::arg("ratio"), py::arg("table"), py::arg("theta"),
      "Xi^{-1}(theta): output angle of each motor angle.");
  module.def(
      "gear_outputs",
      [](double ratio, const GearTable& table, const Values& theta) {
        require_gear("gear", ratio, table);
        auto phi = new_array(theta.size()), u = new_array(theta.size());
        const double* in = theta.data();
        double *angle = phi.mutable_data(), *there = u.mutable_data();
        const py::ssize_t size = theta.size();
        {
          const ReleasedGil released;
          gear_outputs(ratio, table, in, size, angle, there);
        }
        return std::make_pair(phi, u);
      },
      py::arg("ratio"), py::arg("table"), py::arg("theta"),
      "Xi^{-1}(theta) (N,) and u there (N,), eight at once.");
  module.def(
      "gear_ratio",
      [](double ratio, const GearTable& table, const Values& phi, int order) {
        gear_ratio(ratio, table, 0.0, order);  // refuses a wrong order before the loop
        return each(phi, [&](double angle) { return gear_ratio(ratio, table, angle, order); });
      },
      py::arg("ratio"), py::arg("table"), py::arg("phi"), py::arg("order") = 0,
      "d^order u / dphi^order at each output angle, order 0 to 3; u = dXi/dphi.");
  module.def("gear_table", &gear_table, py::arg("gear"), py::arg("direction"),
             "Table of a direction of motion: -1 cw (the motor angle falls), +1 ccw, 0 the mean of both.");
  module.def("require_gear", &require_gear, py::arg("name"), py::arg("ratio"), py::arg("table"),
             "Raises InvalidArgument, naming the gear, unless the table is whole and Xi monotone.");
}

}  // namespace exactarm::bindings
