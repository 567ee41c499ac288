#include "exactarm/ocp/weight_continuation.hpp"

namespace exactarm::ocp {
namespace {

constexpr double kFirstFactor = 1e-2;   // of the weight, from one trial of a beginning to the next
constexpr int kMostBeginnings = 5;
constexpr double kFactor = 10.0, kMostFactor = 100.0, kLeastFactor = 1.1;
constexpr int kMostAttempts = 50;

bool good(const nlp::Solution& solution) {
  return solution.status == nlp::Status::solved || solution.status == nlp::Status::acceptable;
}

// The secant in log(weight) through two solutions, at most as far again as they lie apart.
nlp::Solution predicted(const nlp::Solution& before, double weight_before, const nlp::Solution& here,
                        double weight, double next) {
  const double share = std::min(std::log(next / weight) / std::log(weight / weight_before), 1.0);
  const double rescaled = here.objective_scale / before.objective_scale;
  nlp::Solution guess = here;
  guess.point.x += share * (here.point.x - before.point.x);
  guess.point.lambda += share * (here.point.lambda - rescaled * before.point.lambda);
  return guess;
}

}  // namespace

nlp::Solution continue_weight(const Problem& problem, const nlp::Solution& failed, const Attempt& attempt) {
  int iterations = failed.iterations;
  Problem weighed = problem;
  const auto tried = [&](double weight, const nlp::Solution* start) {
    weighed.weight = weight;
    nlp::Solution solution = attempt(weighed, start, weight == problem.weight);
    iterations += solution.iterations;
    return solution;
  };
  nlp::Solution here, before;
  double weight = problem.weight, weight_before = 0.0;
  for (int beginning = 0; beginning < kMostBeginnings && !good(here); ++beginning)
    here = tried(weight *= kFirstFactor, nullptr);

  double factor = kFactor;
  for (int count = 0; count < kMostAttempts && good(here) && weight < problem.weight && factor > kLeastFactor;
       ++count) {
    const double next = weight * factor < 0.99 * problem.weight ? weight * factor : problem.weight;
    const nlp::Solution guess =
        weight_before > 0.0 ? predicted(before, weight_before, here, weight, next) : here;
    nlp::Solution ahead = tried(next, &guess);
    if (ahead.status == nlp::Status::time_limit) break;
    if (!good(ahead)) {
      factor = std::sqrt(std::min(factor, next / weight));
      continue;
    }
    before = std::move(here);
    here = std::move(ahead);
    weight_before = weight;
    weight = next;
    factor = std::min(factor * factor, kMostFactor);
  }
  const bool arrived = good(here) && weight == problem.weight;
  nlp::Solution answer = arrived ? std::move(here) : failed;
  answer.iterations = iterations;
  return answer;
}

}  // namespace exactarm::ocp
