#include "exactarm/ocp/solution.hpp"

#include "binding.hpp"
#include "exactarm/ocp/robot_dynamics.hpp"

namespace exactarm::bindings {
namespace {

// An array that can be replaced is handed out as a copy:
// a view of it would outlive the memory that it looks at.
template <class Owner, class Array>
auto copy_of(Array Owner::*member) {
  return [member](const Owner& owner) { return Array(owner.*member); };
}
template <class Owner, class Array>
auto setter_of(Array Owner::*member) {
  return [member](Owner& owner, const Array& value) { owner.*member = value; };
}

}  // namespace

void bind_solution(py::module_& module) {
  using namespace ocp;

  py::enum_<Input>(module, "PlanInput").value("acceleration", Input::acceleration).value("jerk", Input::jerk);
  py::enum_<Method>(module, "PlanMethod").value("stagewise", Method::stagewise).value("ipopt", Method::ipopt);

  py::class_<Bounds>(module, "PlanBounds")
      .def_property("q_min", copy_of(&Bounds::q_min), setter_of(&Bounds::q_min))
      .def_property("q_max", copy_of(&Bounds::q_max), setter_of(&Bounds::q_max))
      .def_property("q_dot", copy_of(&Bounds::q_dot), setter_of(&Bounds::q_dot))
      .def_property("theta_min", copy_of(&Bounds::theta_min), setter_of(&Bounds::theta_min))
      .def_property("theta_max", copy_of(&Bounds::theta_max), setter_of(&Bounds::theta_max))
      .def_property("theta_dot", copy_of(&Bounds::theta_dot), setter_of(&Bounds::theta_dot))
      .def_property("theta_ddot", copy_of(&Bounds::theta_ddot), setter_of(&Bounds::theta_ddot))
      .def_property("theta_dddot", copy_of(&Bounds::theta_dddot), setter_of(&Bounds::theta_dddot));

  py::class_<Problem>(module, "PlanProblem")
      .def(py::init(&problem_of), py::arg("robot"))
      .def_readwrite("step", &Problem::step)
      .def_readwrite("weight", &Problem::weight)
      .def_readwrite("input", &Problem::input)
      .def_property("q_desired", copy_of(&Problem::q_desired), setter_of(&Problem::q_desired))
      .def_property("direction", copy_of(&Problem::direction), setter_of(&Problem::direction))
      .def_property("phi_shift", copy_of(&Problem::phi_shift), setter_of(&Problem::phi_shift))
      .def_readwrite("gears", &Problem::gears)
      .def_readwrite("springs", &Problem::springs)
      .def_property("q_offset", copy_of(&Problem::q_offset), setter_of(&Problem::q_offset))
      .def_readwrite("bounds", &Problem::bounds);

  py::class_<SolveOptions>(module, "PlanOptions")
      .def(py::init<>())
      .def_readwrite("method", &SolveOptions::method)
      .def_readwrite("linear_solver", &SolveOptions::linear_solver)
      .def_readwrite("iterations", &SolveOptions::iterations)
      .def_readwrite("seconds", &SolveOptions::seconds)
      .def_readwrite("threads", &SolveOptions::threads)
      .def_readwrite("print_level", &SolveOptions::print_level);

  py::class_<Motion>(module, "PlanMotion")
      .def_property_readonly("status", [](const Motion& motion) { return nlp::status_name(motion.status); })
      .def_readonly("message", &Motion::message)
      .def_readonly("linear_solver", &Motion::linear_solver)
      .def_readonly("iterations", &Motion::iterations)
      .def_readonly("seconds", &Motion::seconds)
      .def_readonly("objective", &Motion::objective)
      .def_readonly("objective_scale", &Motion::objective_scale)
      .def_property_readonly("kkt_stationarity", [](const Motion& motion) { return motion.kkt.stationarity; })
      .def_property_readonly("kkt_feasibility", [](const Motion& motion) { return motion.kkt.feasibility; })
      .def_property_readonly("kkt_complementarity",
                             [](const Motion& motion) { return motion.kkt.complementarity; })
      .def_property_readonly("kkt_error", [](const Motion& motion) { return motion.kkt.largest(); })
      .def_readonly("q", &Motion::q)
      .def_readonly("q_dot", &Motion::q_dot)
      .def_readonly("q_ddot", &Motion::q_ddot)
      .def_readonly("theta", &Motion::theta)
      .def_readonly("theta_dot", &Motion::theta_dot)
      .def_readonly("theta_ddot", &Motion::theta_ddot)
      .def_readonly("theta_dddot", &Motion::theta_dddot)
      .def_readonly("stage_multipliers", &Motion::stage_multipliers);

  module.def(
      "plan_motion",
      [](const Robot& robot, const Problem& problem, const SolveOptions& options) {
        const ReleasedGil released;
        return solve(problem, RobotDynamics(robot), options);
      },
      py::arg("robot"), py::arg("problem"), py::arg("options") = SolveOptions(),
      "The motor motion that puts the links on the reference; the status says how it ended.");

  module.def(
      "ma27_available",
      [] {
        std::string reason;
        const bool available = nlp::ma27_available(&reason);
        return py::make_tuple(available, reason);
      },
      "Whether MA27 was found, and if not what was tried.");
}

}  // namespace exactarm::bindings
