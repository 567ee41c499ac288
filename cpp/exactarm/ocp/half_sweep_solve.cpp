// The right-hand sides of HalfSweep: gradients from the inner end outwards, then the motion inwards.
#include "exactarm/ocp/half_sweep.hpp"

#include "exactarm/base/interrupt.hpp"

namespace exactarm::ocp {

// The constant between a knot's outgoing state and the next knot's incoming one.
template <int Axes, int MotorOrder>
const double* HalfSweep<Axes, MotorOrder>::jump(const KktVector& right, long position, double& sign) const {
  sign = direction_ > 0 ? -1.0 : 1.0;
  const long defect = direction_ > 0 ? knot(position) : knot(position) - 1;
  return right.defect.data() + defect * states();
}

template <int Axes, int MotorOrder>
void HalfSweep<Axes, MotorOrder>::backward(const KktVector& right, const double* force) {
  const int m = n(), s = states(), w = width(), r = rest();
  double *out = work_.data(), *y = out + w, *offset = y + w;
  const Knot end = at(count_);
  for (int i = 0; i < s; ++i) end.gradient[i] = force ? force[i] : 0.0;
  for (long position = count_ - 1; position >= 0; --position) {
    if (position % kKnotsBetweenChecks == 0) check_interrupt();
    const Knot here = at(position), next = at(position + 1);
    // Gradient at the outgoing state; behind the last knot there is only the force.
    std::copy_n(next.gradient, s, out);
    if (position + 1 < count_) {
      double sign;
      const double* step = jump(right, position, sign);
      for (int j = 0; j < s; ++j) {
        const double value = sign * step[j];
        if (value == 0.0) continue;
        for (int i = 0; i < s; ++i) out[i] += value * next.value[j * s + i];
      }
    }
    const double* g = right.z.data() + knot(position) * w;
    std::fill_n(y, w, 0.0);
    for (int b = 0; b < kStateBlocks; ++b) {
      const double* block = g + Layout::state_block(b) * m;
      for (int c = 0; c < kBlocks; ++c) {
        if (x_of_[b][c] != 0.0)
          for (int i = 0; i < m; ++i) y[c * m + i] += x_of_[b][c] * block[i];
        if (out_of_[b][c] != 0.0)
          for (int i = 0; i < m; ++i) y[c * m + i] += out_of_[b][c] * out[b * m + i];
      }
    }
    double *y_qdd = y + s, *y_input = y + s + m;
    for (int i = 0; i < m; ++i) {
      y_qdd[i] += g[kQDdot * m + i];
      y_input[i] += g[layout_.input() * m + i];
    }
    std::copy_n(y_qdd, m, here.qdd_gradient);
    const double* residual = right.stage.data() + knot(position) * m;
    for (int i = 0; i < m; ++i) {
      double sum = 0.0;
      for (int j = 0; j < m; ++j) sum -= here.inverse[j * m + i] * residual[j];
      here.qdd_offset[i] = sum;
    }
    for (int i = 0; i < m; ++i) {
      offset[i] = y_qdd[i];
      for (int j = 0; j < m; ++j) offset[i] += here.qdd_by_qdd[j * m + i] * here.qdd_offset[j];
    }
    // rest = (sigma, input) with the substituted qdd.
    double* reduced = offset + m;
    std::copy_n(y, s, reduced);
    std::copy_n(y_input, m, reduced + s);
    for (int j = 0; j < m; ++j)
      for (int i = 0; i < r; ++i) reduced[i] += here.rest_by_qdd[j * r + i] * here.qdd_offset[j];
    for (int i = 0; i < r; ++i) {
      double sum = 0.0;
      for (int j = 0; j < m; ++j) sum += here.qdd_by_rest[i * m + j] * offset[j];
      reduced[i] += sum;
    }
    y_input = reduced + s;
    for (int i = 0; i < m; ++i) {
      double sum = 0.0;
      for (int j = 0; j < m; ++j) sum -= here.input_inverse[j * m + i] * y_input[j];
      here.input_offset[i] = sum;
    }
    for (int i = 0; i < s; ++i) {
      double sum = reduced[i];
      for (int j = 0; j < m; ++j) sum += here.gain[i * m + j] * y_input[j];
      here.gradient[i] = sum;
    }
  }
}

template <int Axes, int MotorOrder>
void HalfSweep<Axes, MotorOrder>::next_state(const double* sigma, const double* qdd, const double* input,
                                             double* x, double* out) const {
  const int m = n();
  const double half = 0.5 * direction_;
  for (int b = kStateBlocks - 1; b >= 0; --b) {
    const double* after = b == kStateBlocks - 1 ? input : b == kLinkOrder - 1 ? qdd : x + (b + 1) * m;
    for (int i = 0; i < m; ++i) {
      x[b * m + i] = sigma[b * m + i] + half * after[i];
      out[b * m + i] = sigma[b * m + i] + 2.0 * half * after[i];
    }
  }
}

template <int Axes, int MotorOrder>
void HalfSweep<Axes, MotorOrder>::forward(const KktVector& right, KktVector* solution, double* inner) {
  const int m = n(), s = states(), w = width(), r = rest();
  double *sigma = work_.data(), *rest_value = sigma, *qdd = work_.data() + w, *x = qdd + m, *out = x + s;
  // The outer end stands still: only its defect enters.
  for (int i = 0; i < s; ++i)
    sigma[i] = direction_ > 0 ? -right.defect[(knot(0) - 1) * s + i] : right.defect[knot(0) * s + i];
  for (long position = 0; position < count_; ++position) {
    if (position % kKnotsBetweenChecks == 0) check_interrupt();
    const Knot here = at(position);
    const long k = knot(position);
    double* input = rest_value + s;
    for (int i = 0; i < m; ++i) input[i] = here.input_offset[i];
    for (int j = 0; j < s; ++j)
      for (int i = 0; i < m; ++i) input[i] += here.gain[j * m + i] * sigma[j];
    for (int i = 0; i < m; ++i) qdd[i] = here.qdd_offset[i];
    for (int j = 0; j < r; ++j)
      for (int i = 0; i < m; ++i) qdd[i] += here.qdd_by_rest[j * m + i] * rest_value[j];
    next_state(sigma, qdd, input, x, out);
    if (solution) {
      double* z = solution->z.data() + k * w;
      for (int b = 0; b < kStateBlocks; ++b) std::copy_n(x + b * m, m, z + Layout::state_block(b) * m);
      std::copy_n(qdd, m, z + kQDdot * m);
      std::copy_n(input, m, z + layout_.input() * m);
      // lambda from the stationarity of qdd, pi from the cost to go in front of the knot.
      double* const force = out + s;
      for (int i = 0; i < m; ++i) {
        double sum = here.qdd_gradient[i];
        for (int j = 0; j < m; ++j) sum += here.qdd_by_qdd[j * m + i] * qdd[j];
        for (int j = 0; j < r; ++j) sum += here.rest_by_qdd[i * r + j] * rest_value[j];
        force[i] = sum;
      }
      for (int i = 0; i < m; ++i) {
        double sum = 0.0;
        for (int j = 0; j < m; ++j) sum -= here.inverse[i * m + j] * force[j];
        solution->stage[k * m + i] = sum;
      }
      double* pi = solution->defect.data() + (direction_ > 0 ? k - 1 : k) * s;
      const double sign = direction_ > 0 ? -1.0 : 1.0;
      for (int i = 0; i < s; ++i) pi[i] = sign * here.gradient[i];
      for (int j = 0; j < s; ++j) {
        const double value = sign * sigma[j];
        for (int i = 0; i < s; ++i) pi[i] += here.value[j * s + i] * value;
      }
    }
    std::copy_n(out, s, sigma);
    if (position + 1 < count_) {
      double sign;
      const double* step = jump(right, position, sign);
      for (int i = 0; i < s; ++i) sigma[i] += sign * step[i];
    }
  }
  std::copy_n(sigma, s, inner);
}

template void HalfSweep<6, 2>::backward(const KktVector&, const double*);
template void HalfSweep<6, 3>::backward(const KktVector&, const double*);
template void HalfSweep<Eigen::Dynamic, 2>::backward(const KktVector&, const double*);
template void HalfSweep<Eigen::Dynamic, 3>::backward(const KktVector&, const double*);
template void HalfSweep<6, 2>::forward(const KktVector&, KktVector*, double*);
template void HalfSweep<6, 3>::forward(const KktVector&, KktVector*, double*);
template void HalfSweep<Eigen::Dynamic, 2>::forward(const KktVector&, KktVector*, double*);
template void HalfSweep<Eigen::Dynamic, 3>::forward(const KktVector&, KktVector*, double*);

}  // namespace exactarm::ocp
