#include "binding.hpp"

namespace exactarm::bindings {

void bind_robot(py::module_& module) {
  py::register_exception<InvalidArgument>(module, "InvalidArgument", PyExc_ValueError);

  py::enum_<JointType>(module, "JointType")
      .value("revolute", JointType::revolute)
      .value("prismatic", JointType::prismatic);

  // Values: made whole, never changed. A robot holds copies of them.
  py::class_<Pose>(module, "Pose")
      .def(py::init<>())
      .def(
          py::init([](const Matrix3& rotation, const Vector3& position) { return Pose{rotation, position}; }),
          py::arg("rotation"), py::arg("position"))
      .def_readonly("rotation", &Pose::rotation)
      .def_readonly("position", &Pose::position);

  py::class_<Frame>(module, "Frame")
      .def(py::init([](JointType type, double sign, double zero, double d, double a, double alpha,
                       double beta) { return Frame{type, sign, zero, d, a, alpha, beta}; }),
           py::arg("type") = JointType::revolute, py::arg("sign") = 1.0, py::arg("zero") = 0.0,
           py::arg("d") = 0.0, py::arg("a") = 0.0, py::arg("alpha") = 0.0, py::arg("beta") = 0.0)
      .def_readonly("type", &Frame::type)
      .def_readonly("sign", &Frame::sign)
      .def_readonly("zero", &Frame::zero)
      .def_readonly("d", &Frame::d)
      .def_readonly("a", &Frame::a)
      .def_readonly("alpha", &Frame::alpha)
      .def_readonly("beta", &Frame::beta);

  py::class_<LinkInertia>(module, "LinkInertia")
      .def(py::init([](double mass, const Vector3& centre_of_mass, const Matrix3& inertia) {
             return LinkInertia{mass, centre_of_mass, inertia};
           }),
           py::arg("mass"), py::arg("centre_of_mass"), py::arg("inertia"))
      .def_readonly("mass", &LinkInertia::mass)
      .def_readonly("centre_of_mass", &LinkInertia::centre_of_mass)
      .def_readonly("inertia", &LinkInertia::inertia);

  py::class_<GearTable>(module, "GearTable")
      .def(py::init<>())
      .def(py::init<Vector, Vector, Vector>(), py::arg("order"), py::arg("a"), py::arg("b"))
      .def_property_readonly("order", &GearTable::order)
      .def_property_readonly("a", &GearTable::a)
      .def_property_readonly("b", &GearTable::b);

  py::class_<Gear>(module, "Gear")
      .def(py::init(
               [](double ratio, const GearTable& cw, const GearTable& ccw) { return Gear{ratio, cw, ccw}; }),
           py::arg("ratio") = 1.0, py::arg("cw") = GearTable(), py::arg("ccw") = GearTable())
      .def_readonly("ratio", &Gear::ratio)
      .def_readonly("cw", &Gear::cw)
      .def_readonly("ccw", &Gear::ccw);

  py::class_<Spring>(module, "Spring")
      .def(py::init([](double linear, double cubic) { return Spring{linear, cubic}; }),
           py::arg("linear") = 0.0, py::arg("cubic") = 0.0)
      .def_readonly("linear", &Spring::linear)
      .def_readonly("cubic", &Spring::cubic);

  py::class_<Friction>(module, "Friction")
      .def(py::init([](double coulomb, double viscous, double stribeck, double stribeck_velocity) {
             return Friction{coulomb, viscous, stribeck, stribeck_velocity};
           }),
           py::arg("coulomb") = 0.0, py::arg("viscous") = 0.0, py::arg("stribeck") = 0.0,
           py::arg("stribeck_velocity") = Friction().stribeck_velocity)
      .def_readonly("coulomb", &Friction::coulomb)
      .def_readonly("viscous", &Friction::viscous)
      .def_readonly("stribeck", &Friction::stribeck)
      .def_readonly("stribeck_velocity", &Friction::stribeck_velocity);

  py::class_<Drive>(module, "Drive")
      .def(py::init([](double rotor_inertia, const Friction& joint, const Friction& motor) {
             return Drive{rotor_inertia, joint, motor};
           }),
           py::arg("rotor_inertia") = 0.0, py::arg("joint") = Friction(), py::arg("motor") = Friction())
      .def_readonly("rotor_inertia", &Drive::rotor_inertia)
      .def_readonly("joint", &Drive::joint)
      .def_readonly("motor", &Drive::motor);

  py::class_<Limits>(module, "Limits")
      .def(py::init([](double q_min, double q_max, double q_dot_max, double q_ddot_max, double torque_max) {
             return Limits{q_min, q_max, q_dot_max, q_ddot_max, torque_max};
           }),
           py::arg("q_min") = -Limits::kNone, py::arg("q_max") = Limits::kNone,
           py::arg("q_dot_max") = Limits::kNone, py::arg("q_ddot_max") = Limits::kNone,
           py::arg("torque_max") = Limits::kNone)
      .def_readonly("q_min", &Limits::q_min)
      .def_readonly("q_max", &Limits::q_max)
      .def_readonly("q_dot_max", &Limits::q_dot_max)
      .def_readonly("q_ddot_max", &Limits::q_ddot_max)
      .def_readonly("torque_max", &Limits::torque_max);

  py::class_<Joint>(module, "Joint", "One axis and the link that it moves; link None: its mass is not known.")
      .def(py::init([](const Frame& frame, double q_offset, const Gear& gear, const Spring& spring,
                       const Drive& drive, const Limits& limits, const std::optional<LinkInertia>& link) {
             return Joint{frame, q_offset, gear, spring, drive, limits, link};
           }),
           py::arg("frame") = Frame(), py::arg("q_offset") = 0.0, py::arg("gear") = Gear(),
           py::arg("spring") = Spring(), py::arg("drive") = Drive(), py::arg("limits") = Limits(),
           py::arg("link") = py::none())
      .def_readonly("frame", &Joint::frame)
      .def_readonly("q_offset", &Joint::q_offset)
      .def_readonly("gear", &Joint::gear)
      .def_readonly("spring", &Joint::spring)
      .def_readonly("drive", &Joint::drive)
      .def_readonly("limits", &Joint::limits)
      .def_readonly("link", &Joint::link);

  py::class_<Robot>(module, "Robot", "A serial robot, checked when it is made and never changed.")
      .def(py::init([](std::vector<Joint> joints, const Pose& base, const Pose& tool,
                       const Vector3& gravity) { return Robot({std::move(joints), base, tool, gravity}); }),
           py::arg("joints"), py::arg("base") = Pose(), py::arg("tool") = Pose(),
           py::arg("gravity") = RobotDescription().gravity)
      .def_property_readonly("joints", &Robot::joints)
      .def_property_readonly("base", &Robot::base)
      .def_property_readonly("tool", &Robot::tool)
      .def_property_readonly("gravity", &Robot::gravity)
      .def_property_readonly("has_masses", &Robot::has_masses)
      .def_property_readonly("axes", &Robot::axes);
}

}  // namespace exactarm::bindings
