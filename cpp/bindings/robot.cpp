#include "binding.hpp"

namespace exactarm::bindings {

void bind_robot(py::module_& module) {
  py::register_exception<InvalidArgument>(module, "InvalidArgument", PyExc_ValueError);

  py::enum_<JointType>(module, "JointType")
      .value("revolute", JointType::revolute)
      .value("prismatic", JointType::prismatic);

  py::class_<Pose>(module, "Pose")
      .def(py::init<>())
      .def(py::init([](const Matrix3& rotation, const Vector3& position) { return Pose{rotation, position}; }),
           py::arg("rotation"), py::arg("position"))
      .def_readwrite("rotation", &Pose::rotation)
      .def_readwrite("position", &Pose::position);

  py::class_<Frame>(module, "Frame")
      .def(py::init<>())
      .def_readwrite("type", &Frame::type)
      .def_readwrite("sign", &Frame::sign)
      .def_readwrite("zero", &Frame::zero)
      .def_readwrite("d", &Frame::d)
      .def_readwrite("a", &Frame::a)
      .def_readwrite("alpha", &Frame::alpha)
      .def_readwrite("beta", &Frame::beta);

  py::class_<LinkInertia>(module, "LinkInertia")
      .def(py::init<>())
      .def_readwrite("mass", &LinkInertia::mass)
      .def_readwrite("centre_of_mass", &LinkInertia::centre_of_mass)
      .def_readwrite("inertia", &LinkInertia::inertia);

  py::class_<GearTable>(module, "GearTable")
      .def(py::init<>())
      .def_readwrite("order", &GearTable::order)
      .def_readwrite("a", &GearTable::a)
      .def_readwrite("b", &GearTable::b);

  py::class_<Gear>(module, "Gear")
      .def(py::init<>())
      .def_readwrite("ratio", &Gear::ratio)
      .def_readwrite("cw", &Gear::cw)
      .def_readwrite("ccw", &Gear::ccw);

  py::class_<Spring>(module, "Spring")
      .def(py::init<>())
      .def_readwrite("linear", &Spring::linear)
      .def_readwrite("cubic", &Spring::cubic);

  py::class_<Friction>(module, "Friction")
      .def(py::init<>())
      .def_readwrite("coulomb", &Friction::coulomb)
      .def_readwrite("viscous", &Friction::viscous)
      .def_readwrite("stribeck", &Friction::stribeck)
      .def_readwrite("stribeck_velocity", &Friction::stribeck_velocity);

  py::class_<Drive>(module, "Drive")
      .def(py::init<>())
      .def_readwrite("rotor_inertia", &Drive::rotor_inertia)
      .def_readwrite("joint", &Drive::joint)
      .def_readwrite("motor", &Drive::motor);

  py::class_<Limits>(module, "Limits")
      .def(py::init<>())
      .def_readwrite("q_min", &Limits::q_min)
      .def_readwrite("q_max", &Limits::q_max)
      .def_readwrite("q_dot_max", &Limits::q_dot_max)
      .def_readwrite("q_ddot_max", &Limits::q_ddot_max)
      .def_readwrite("torque_max", &Limits::torque_max);

  py::class_<Robot>(module, "Robot")
      .def(py::init<>())
      .def_readwrite("frames", &Robot::frames)
      .def_readwrite("q_offset", &Robot::q_offset)
      .def_readwrite("links", &Robot::links)
      .def_readwrite("gears", &Robot::gears)
      .def_readwrite("springs", &Robot::springs)
      .def_readwrite("drives", &Robot::drives)
      .def_readwrite("limits", &Robot::limits)
      .def_readwrite("base", &Robot::base)
      .def_readwrite("tool", &Robot::tool)
      .def_readwrite("gravity", &Robot::gravity)
      .def_property_readonly("axes", &Robot::axes);
}

}  // namespace exactarm::bindings
