#include "exactarm/base/check.hpp"
#include "exactarm/base/derivative.hpp"
#include "exactarm/robot/stop_operator.hpp"

#include "binding.hpp"

namespace exactarm::bindings {
void bind_signals(py::module_& module) {
  module.def(
      "derivative",
      [](const Values& values, const Values& time, const std::vector<long>& starts) {
        if (values.ndim() == 0) throw InvalidArgument("values: expected samples (N, ...), found one number");
        const long rows = values.shape(0), columns = rows ? values.size() / rows : 0;
        require_size("time", time.size(), rows);
        py::array_t<double> out(std::vector<py::ssize_t>(values.shape(), values.shape() + values.ndim()));
        const double *in = values.data(), *at = time.data();
        double* result = out.mutable_data();
        {
          const ReleasedGil released;
          derivative(in, at, rows, columns, starts, result);
        }
        return out;
      },
      py::arg("values"), py::arg("time"), py::arg("starts"),
      "d/dt of samples (N, ...) at time (N,), block by block from each row in starts on.");
  module.def(
      "stop_operator",
      [](const Values& motion, double reach) {
        auto memory = new_array(motion.size()), by_reach = new_array(motion.size());
        stop_operator(motion.data(), motion.size(), reach, memory.mutable_data(), by_reach.mutable_data());
        return std::make_pair(memory, by_reach);
      },
      py::arg("motion"), py::arg("reach"),
      "Motion (N,) held within +-reach, over the reach, and its derivative by it.");
}

}  // namespace exactarm::bindings
