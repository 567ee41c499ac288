#include "exactarm/robot/harmonics.hpp"

#include "binding.hpp"
#include "exactarm/base/check.hpp"

namespace exactarm::bindings {
void bind_harmonics(py::module_& module) {
  module.def(
      "delivered_angle",
      [](const Values& phi, const Vector& order, const Vector& a, const Vector& b, const Values& factor,
         double tolerance, int threads) {
        const GearTable table(order, a, b);
        if (factor.size()) require_size("factor", factor.size(), phi.size());
        auto x = new_array(phi.size()), slope = new_array(phi.size());
        const double *in = phi.data(), *scale = factor.size() ? factor.data() : nullptr;
        double *angle = x.mutable_data(), *out = slope.mutable_data();
        const long count = phi.size();
        {
          const ReleasedGil released;
          delivered_angles(table, in, scale, count, tolerance, threads, angle, out);
        }
        return std::make_pair(x, slope);
      },
      py::arg("phi"), py::arg("order"), py::arg("a"), py::arg("b"), py::arg("factor"), py::arg("tolerance"),
      py::arg("threads") = 1,
      "x (N,) with x + factor e(x) = phi, factor empty for 1, and the slope s(x) of e there.");
  module.def(
      "transmission",
      [](const Values& x, const Vector& order, const Vector& a, const Vector& b, int threads) {
        const GearTable table(order, a, b);
        auto error = new_array(x.size()), slope = new_array(x.size());
        const double* in = x.data();
        double *e = error.mutable_data(), *s = slope.mutable_data();
        const long count = x.size();
        {
          const ReleasedGil released;
          transmission(table, in, count, threads, e, s);
        }
        return std::make_pair(error, slope);
      },
      py::arg("x"), py::arg("order"), py::arg("a"), py::arg("b"), py::arg("threads") = 1,
      "Transmission error e (N,) and its slope s (N,) at the output angles x.");
  module.def(
      "waves",
      [](const Values& x, const Vector& order) {
        auto sine = new_array(x.size(), order.size()), cosine = new_array(x.size(), order.size());
        const double* in = x.data();
        double *s = sine.mutable_data(), *c = cosine.mutable_data();
        const long count = x.size();
        {
          const ReleasedGil released;
          waves(order, in, count, s, c);
        }
        return std::make_pair(sine, cosine);
      },
      py::arg("x"), py::arg("order"), "sin(w x) and cos(w x), (N, m).");
}

}  // namespace exactarm::bindings
