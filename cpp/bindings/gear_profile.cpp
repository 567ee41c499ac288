#include "exactarm/robot/gear_profile.hpp"

#include "binding.hpp"

namespace exactarm::bindings {

void bind_gear_profile(py::module_& module) {
  module.def(
      "profile_normal",
      [](ConstVectorRef angle, ConstVectorRef value, ConstVectorRef weight, bool rated, const Vector& order,
         const Vector& a, const Vector& b, double level, bool with_orders) {
        ProfileNormal result;
        {
          const ReleasedGil released;
          result = profile_normal({angle, value, weight, rated}, {order, a, b}, level, with_orders);
        }
        return std::make_tuple(std::move(result.normal), std::move(result.gradient),
                               std::move(result.residual));
      },
      py::arg("angle"), py::arg("value"), py::arg("weight"), py::arg("rated"), py::arg("order"), py::arg("a"),
      py::arg("b"), py::arg("level"), py::arg("with_orders") = false,
      "J' W J, J' W r and r of an angle profile at coefficients a, b, level; columns a, b, level "
      "and the orders.");
}

}  // namespace exactarm::bindings
