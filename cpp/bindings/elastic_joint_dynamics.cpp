#include "exactarm/robot/elastic_joint_dynamics.hpp"

#include "binding.hpp"
#include "exactarm/robot/elasticity.hpp"
#include "exactarm/robot/friction.hpp"

namespace exactarm::bindings {

void bind_elastic_joint_dynamics(py::module_& module) {
  module.def("coriolis_matrix", &coriolis_matrix, py::arg("robot"), py::arg("q"), py::arg("q_dot"),
             "C(q, q_dot) by Christoffel symbols, (axes, axes).");
  module.def("spring_torque", py::vectorize([](double linear, double cubic, double deflection) {
               return spring_torque({linear, cubic}, deflection);
             }),
             py::arg("linear"), py::arg("cubic"), py::arg("deflection"), "k1 e + k3 e^3 in Nm.");
  module.def("spring_deflection", py::vectorize([](double linear, double cubic, double torque) {
               return spring_deflection({linear, cubic}, torque);
             }),
             py::arg("linear"), py::arg("cubic"), py::arg("torque"),
             "The e with k1 e + k3 e^3 = torque, rad.");
  module.def(
      "friction_torque",
      [](const Friction& parameters, double rate, double width) {
        return friction(parameters, rate, width).torque;
      },
      py::arg("friction"), py::arg("rate"), py::arg("width"),
      "Friction torque at a rate; width of tanh in rad/s, 0: exact sign.");

  py::class_<ElasticJointModel>(module, "ElasticJointModel")
      .def(py::init([](const Robot& robot, bool rotor_coupling, std::vector<int> gear_direction,
                       double friction_width) {
             return ElasticJointModel(robot, {rotor_coupling, std::move(gear_direction), friction_width});
           }),
           py::arg("robot"), py::arg("rotor_coupling") = false,
           py::arg("gear_direction") = std::vector<int>(),
           py::arg("friction_width") = ElasticJointOptions{}.friction_width,
           "Motors, springs and links of a robot: (2.22) with rotor_coupling, (2.23) without.")
      .def_property_readonly("axes", &ElasticJointModel::size);

  py::class_<ElasticJointDynamics>(
      module, "ElasticJointDynamics",
      "State x = (q, q_dot, theta, theta_dot), acceleration a = (q_ddot, theta_ddot), "
      "torques = (external on the links, motors at the shaft).")
      .def(py::init<const ElasticJointModel&>(), py::arg("model"), py::keep_alive<1, 2>())
      .def(
          "forward",
          [](ElasticJointDynamics& self, ConstVectorRef x, ConstVectorRef torques) {
            Vector a(2 * self.size());
            self.forward(x, torques, a);
            return a;
          },
          py::arg("x"), py::arg("torques"))
      .def(
          "inverse",
          [](ElasticJointDynamics& self, ConstVectorRef x, ConstVectorRef a) {
            Vector torques(2 * self.size());
            self.inverse(x, a, torques);
            return torques;
          },
          py::arg("x"), py::arg("a"))
      .def(
          "rate_jacobian",
          [](ElasticJointDynamics& self, ConstVectorRef x, ConstVectorRef a) {
            Matrix jacobian(4 * self.size(), 4 * self.size());
            self.rate_jacobian(x, a, jacobian);
            return jacobian;
          },
          py::arg("x"), py::arg("a"), "d xdot / dx at the accelerations that forward() gave.")
      .def(
          "energy",
          [](ElasticJointDynamics& self, ConstVectorRef x) {
            const ElasticJointEnergy energy = self.energy(x);
            return py::make_tuple(energy.kinetic, energy.gravity, energy.spring);
          },
          py::arg("x"), "Kinetic, gravity and spring energy in J.")
      .def(
          "matrices",
          [](ElasticJointDynamics& self, ConstVectorRef x) {
            ElasticJointMatrices out(self.size());
            self.matrices(x, out);
            return py::make_tuple(out.D, out.C, out.g);
          },
          py::arg("x"), "D, C, g of D a + C (q_dot, theta_dot) + g = torques, without friction.");
}

}  // namespace exactarm::bindings
