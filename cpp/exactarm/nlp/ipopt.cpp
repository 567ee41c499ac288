#include "exactarm/nlp/ipopt.hpp"

#include <HSLLoader.h>
#include <IpIpoptApplication.hpp>
#include <IpSolveStatistics.hpp>
#include <IpTNLP.hpp>
#include <dlfcn.h>

#include <chrono>

#include "exactarm/base/check.hpp"
#include "exactarm/base/interrupt.hpp"

namespace exactarm::nlp {
namespace {

using Ipopt::Index;
using Ipopt::Number;
using Ipopt::SmartPtr;

Eigen::Map<const Vector> view(const Number* data, long size) { return Eigen::Map<const Vector>(data, size); }
Eigen::Map<Vector> view(Number* data, long size) { return Eigen::Map<Vector>(data, size); }

void copy_sparsity(const Sparsity& sparsity, Index* row, Index* column) {
  std::copy(sparsity.row.begin(), sparsity.row.end(), row);
  std::copy(sparsity.column.begin(), sparsity.column.end(), column);
}

class Adapter : public Ipopt::TNLP {
 public:
  Adapter(Problem& problem, double scale, Solution& solution)
      : problem_(problem), scale_(scale), solution_(solution) {}

  bool get_nlp_info(Index& n, Index& m, Index& nnz_jac, Index& nnz_hess, IndexStyleEnum& style) override {
    n = static_cast<Index>(problem_.variables());
    m = static_cast<Index>(problem_.constraints());
    nnz_jac = static_cast<Index>(problem_.jacobian_sparsity().size());
    nnz_hess = static_cast<Index>(problem_.hessian_sparsity().size());
    style = C_STYLE;
    return true;
  }
  bool get_bounds_info(Index n, Number* x_l, Number* x_u, Index m, Number* g_l, Number* g_u) override {
    problem_.variable_bounds(view(x_l, n), view(x_u, n));
    problem_.constraint_bounds(view(g_l, m), view(g_u, m));
    return true;
  }
  bool get_starting_point(Index n, bool, Number* x, bool, Number*, Number*, Index, bool, Number*) override {
    problem_.start(view(x, n));
    return true;
  }
  bool eval_f(Index n, const Number* x, bool, Number& value) override {
    value = scale_ * problem_.objective(view(x, n));
    return std::isfinite(value);
  }
  bool eval_grad_f(Index n, const Number* x, bool, Number* gradient) override {
    problem_.gradient(view(x, n), view(gradient, n));
    view(gradient, n) *= scale_;
    return true;
  }
  bool eval_g(Index n, const Number* x, bool, Index m, Number* c) override {
    problem_.constraint(view(x, n), view(c, m));
    return view(c, m).allFinite();
  }
  bool eval_jac_g(Index n, const Number* x, bool, Index, Index, Index* row, Index* column,
                  Number* values) override {
    if (!values)
      copy_sparsity(problem_.jacobian_sparsity(), row, column);
    else
      problem_.jacobian(view(x, n), values);
    return true;
  }
  bool eval_h(Index n, const Number* x, bool, Number factor, Index m, const Number* lambda, bool, Index,
              Index* row, Index* column, Number* values) override {
    if (!values)
      copy_sparsity(problem_.hessian_sparsity(), row, column);
    else
      problem_.hessian(view(x, n), scale_ * factor, view(lambda, m), values);
    return true;
  }
  bool intermediate_callback(Ipopt::AlgorithmMode, Index, Number, Number, Number, Number, Number, Number,
                             Number, Number, Index, const Ipopt::IpoptData*,
                             Ipopt::IpoptCalculatedQuantities*) override {
    try {
      check_interrupt();
    } catch (...) {
      interruption = std::current_exception();
    }
    return !interruption;
  }
  void finalize_solution(Ipopt::SolverReturn, Index n, const Number* x, const Number* z_l, const Number* z_u,
                         Index m, const Number*, const Number* lambda, Number value, const Ipopt::IpoptData*,
                         Ipopt::IpoptCalculatedQuantities*) override {
    solution_.point = {view(x, n), view(lambda, m), view(z_l, n), view(z_u, n)};
    solution_.objective = value / scale_;
  }

  std::exception_ptr interruption;  // what ended the run from outside

 private:
  Problem& problem_;
  double scale_;
  Solution& solution_;
};

struct Ending {
  Ipopt::ApplicationReturnStatus code;
  Status status;
  const char* message;
};

const Ending kEndings[] = {
    {Ipopt::Solve_Succeeded, Status::solved, "solved"},
    {Ipopt::Solved_To_Acceptable_Level, Status::acceptable, "solved to the acceptable level only"},
    {Ipopt::Infeasible_Problem_Detected, Status::infeasible, "converged to a point of local infeasibility"},
    {Ipopt::Maximum_Iterations_Exceeded, Status::iteration_limit, "iteration limit"},
    {Ipopt::Maximum_CpuTime_Exceeded, Status::time_limit, "time limit"},
    {Ipopt::User_Requested_Stop, Status::stopped, "stopped by the caller"},
    {Ipopt::Search_Direction_Becomes_Too_Small, Status::numerical_failure, "search direction too small"},
    {Ipopt::Diverging_Iterates, Status::numerical_failure, "iterates diverge"},
    {Ipopt::Restoration_Failed, Status::numerical_failure, "restoration failed"},
    {Ipopt::Error_In_Step_Computation, Status::numerical_failure, "error in the step computation"},
    {Ipopt::Invalid_Number_Detected, Status::numerical_failure,
     "a function returned a value that is not finite"},
    {Ipopt::Not_Enough_Degrees_Of_Freedom, Status::infeasible, "fewer variables than equations"},
    {Ipopt::Insufficient_Memory, Status::numerical_failure, "out of memory"},
};

void translate(Ipopt::ApplicationReturnStatus code, Solution& solution) {
  for (const Ending& ending : kEndings) {
    if (ending.code != code) continue;
    solution.status = ending.status;
    solution.message = ending.message;
    return;
  }
  solution.message = "Ipopt returned code " + std::to_string(code);
}

}  // namespace

const char* status_name(Status status) {
  switch (status) {
    case Status::solved: return "solved";
    case Status::acceptable: return "acceptable";
    case Status::infeasible: return "infeasible";
    case Status::iteration_limit: return "iteration_limit";
    case Status::time_limit: return "time_limit";
    case Status::stopped: return "stopped";
    case Status::numerical_failure: return "numerical_failure";
  }
  return "unknown";
}

bool ma27_available(std::string* reason) {
  if (LSL_isMA27available()) return true;
  std::string tried;
  for (const char* name : {"libhsl.so", "libcoinhsl.so", "libcoinhsl.so.2"}) {
    void* handle = dlopen(name, RTLD_LAZY | RTLD_LOCAL);
    tried += (tried.empty() ? "" : ", ") + std::string(name);
    if (!handle) continue;
    dlclose(handle);
    char message[256] = "";
    if (LSL_loadHSL(name, message, sizeof message) == 0 && LSL_isMA27available()) return true;
  }
  if (reason) *reason = "no HSL library with MA27 found on the library path (tried " + tried + ")";
  return false;
}

Solution solve_ipopt(Problem& problem, const IpoptOptions& options) {
  std::string reason;
  if (options.linear_solver != "mumps" && options.linear_solver != "ma27")
    throw InvalidArgument("linear_solver: expected mumps or ma27, found " + options.linear_solver);
  if (options.linear_solver == "ma27" && !ma27_available(&reason))
    throw InvalidArgument("linear_solver = ma27: " + reason + "; mumps is built in");

  Solution solution;
  solution.linear_solver = options.linear_solver;
  solution.objective_scale = options.objective_scale;
  SmartPtr<Ipopt::IpoptApplication> application = new Ipopt::IpoptApplication(options.print_level > 0);
  auto& set = *application->Options();
  set.SetIntegerValue("print_level", options.print_level);
  set.SetIntegerValue("acceptable_iter", 0);
  set.SetStringValue("sb", "yes");
  set.SetStringValue("linear_solver", options.linear_solver);
  set.SetNumericValue("tol", options.tolerance);
  set.SetNumericValue("dual_inf_tol", 1e-4);
  set.SetNumericValue("constr_viol_tol", options.feasibility);
  set.SetNumericValue("compl_inf_tol", options.last_barrier);
  // Below a pivot threshold of 1e-2 MUMPS without its permutation solves to too few digits: the same problem
  // then took anything from 4 to 200 iterations, by the rounding of the day.
  set.SetNumericValue("mumps_pivtol", 1e-2);
  set.SetNumericValue("mu_init", options.first_barrier);
  // Multipliers of the bounds that belong to that barrier; those of the equations come with the first step,
  // and a least-squares estimate would cost a factorisation.
  set.SetStringValue("bound_mult_init_method", "mu-based");
  set.SetNumericValue("constr_mult_init_max", 0.0);
  // At a large objective scale the stationarity has a floor of rounding above ten times the last barriers.
  set.SetNumericValue("barrier_tol_factor", 1e3);
  set.SetNumericValue("bound_relax_factor", 0.0);
  set.SetStringValue("nlp_scaling_method", "none");
  set.SetStringValue("honor_original_bounds", "no");
  set.SetIntegerValue("max_iter", options.iterations);
  set.SetNumericValue("max_cpu_time", options.seconds);
  set.SetIntegerValue("mumps_permuting_scaling", options.permute ? 7 : 0);
  set.SetNumericValue("bound_push", 1e-8);
  set.SetNumericValue("bound_frac", 1e-8);
  if (application->Initialize("") != Ipopt::Solve_Succeeded)
    throw InvalidArgument("Ipopt refused its options");

  const auto begin = std::chrono::steady_clock::now();
  const SmartPtr<Adapter> adapter = new Adapter(problem, options.objective_scale, solution);
  const auto code = application->OptimizeTNLP(SmartPtr<Ipopt::TNLP>(GetRawPtr(adapter)));
  if (adapter->interruption) std::rethrow_exception(adapter->interruption);
  solution.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  translate(code, solution);
  if (IsValid(application->Statistics())) solution.iterations = application->Statistics()->IterationCount();
  if (solution.point.x.size() == 0) {
    solution.point.x = Vector::Zero(problem.variables());
    problem.start(solution.point.x);
    solution.point.lambda = Vector::Zero(problem.constraints());
    solution.point.z_low = solution.point.z_high = Vector::Zero(problem.variables());
  }
  return solution;
}

}  // namespace exactarm::nlp
