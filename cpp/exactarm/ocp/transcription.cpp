#include "exactarm/ocp/transcription.hpp"

#include "exactarm/ocp/initial_guess.hpp"

namespace exactarm::ocp {

Transcription::Transcription(const StageModel& model)
    : model_(model),
      layout_(model.layout()),
      workspace_(model),
      derivatives_(layout_),
      objective_(model.problem()) {
  lambda_.resize(layout_.knots * layout_.axes);
  residual_.resize(layout_.knots * layout_.axes);
  describe_jacobian();
  describe_hessian();
}

long Transcription::constraints() const { return defect_row(layout_.knots - 1); }

void Transcription::variable_bounds(VectorRef low, VectorRef high) const {
  const int width = layout_.width(), n = layout_.axes;
  Vector knot_low(width), knot_high(width);
  knot_bounds(model_.problem(), knot_low, knot_high);
  low = knot_low.replicate(layout_.knots, 1);
  high = knot_high.replicate(layout_.knots, 1);
  Vector end(width);
  for (long k : {0L, layout_.knots - 1}) {
    rest(model_, k, end.data());
    for (int c = 0; c < width; ++c)
      if (c / n != kQDdot) low[k * width + c] = high[k * width + c] = end[c];
  }
}

void Transcription::constraint_bounds(VectorRef low, VectorRef high) const {
  low.setZero();
  high.setZero();
}

void Transcription::start(VectorRef x) const {
  if (start_.size() > 0)
    x = start_;
  else
    initial_guess(model_, x.data());
}

double Transcription::objective(ConstVectorRef x) { return objective_.value(x.data()); }

void Transcription::gradient(ConstVectorRef x, VectorRef gradient) {
  objective_.gradient(x.data(), gradient.data());
}

void Transcription::constraint(ConstVectorRef x, VectorRef c) {
  const int n = layout_.axes, width = layout_.width();
  model_.residual(x.data(), workspace_, residual_.data());
  for (long k = 0; k < layout_.knots; ++k) {
    c.segment(stage_row(k), n) = residual_.segment(k * n, n);
    if (k + 1 == layout_.knots) break;
    for (int s = 0; s < layout_.state_blocks(); ++s) {
      const int b = Layout::state_block(s);
      const auto block = [&](long knot, int which) { return x.segment(knot * width + which * n, n); };
      c.segment(defect_row(k) + s * n, n) =
          block(k + 1, b) - block(k, b) - 0.5 * (block(k, b + 1) + block(k + 1, b + 1));
    }
  }
}

void Transcription::describe_jacobian() {
  const int n = layout_.axes, width = layout_.width();
  const auto add = [&](long row, long column) {
    jacobian_sparsity_.row.push_back(static_cast<int>(row));
    jacobian_sparsity_.column.push_back(static_cast<int>(column));
  };
  for (long k = 0; k < layout_.knots; ++k) {
    for (int block : {kQ, kQDot, kQDdot})
      for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) add(stage_row(k) + i, k * width + block * n + j);
    for (int i = 0; i < n; ++i) add(stage_row(k) + i, k * width + kTheta * n + i);
    if (k + 1 == layout_.knots) break;
    for (int s = 0; s < layout_.state_blocks(); ++s)
      for (int i = 0; i < n; ++i)
        for (long knot : {k, k + 1})
          for (int shift : {0, 1})
            add(defect_row(k) + s * n + i, knot * width + (Layout::state_block(s) + shift) * n + i);
  }
}

void Transcription::jacobian(ConstVectorRef x, double* values) {
  const int n = layout_.axes, n2 = n * n;
  model_.derivatives(x.data(), nullptr, workspace_, derivatives_);
  for (long k = 0; k < layout_.knots; ++k) {
    for (const Vector* part : {&derivatives_.by_q, &derivatives_.by_q_dot, &derivatives_.by_q_ddot}) {
      std::copy_n(part->data() + k * n2, n2, values);
      values += n2;
    }
    std::copy_n(derivatives_.by_theta.data() + k * n, n, values);
    values += n;
    if (k + 1 == layout_.knots) break;
    for (int row = 0; row < layout_.states(); ++row, values += 4) {
      values[0] = -1.0;
      values[1] = values[3] = -0.5;
      values[2] = 1.0;
    }
  }
}

void Transcription::describe_hessian() {
  const int n = layout_.axes, width = layout_.width();
  const auto add = [&](long row, long column) {
    hessian_sparsity_.row.push_back(static_cast<int>(row));
    hessian_sparsity_.column.push_back(static_cast<int>(column));
  };
  for (long k = 0; k < layout_.knots; ++k) {
    const long first = k * width;
    for (int block : {kQ, kQDot})
      for (int j = 0; j < n; ++j)
        for (int i = j; i < n; ++i) add(first + block * n + i, first + block * n + j);
    for (int block : {kQDot, kQDdot})
      for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) add(first + block * n + j, first + i);
    for (int i = 0; i < n; ++i) add(first + kTheta * n + i, first + i);
    for (int block : {static_cast<int>(kTheta), layout_.input()})
      for (int i = 0; i < n; ++i) add(first + block * n + i, first + block * n + i);
  }
}

void Transcription::hessian(ConstVectorRef x, double objective_factor, ConstVectorRef lambda,
                            double* values) {
  const int n = layout_.axes, n2 = n * n;
  for (long k = 0; k < layout_.knots; ++k) lambda_.segment(k * n, n) = lambda.segment(stage_row(k), n);
  model_.derivatives(x.data(), lambda_.data(), workspace_, derivatives_);
  const StageDerivatives& d = derivatives_;
  for (long k = 0; k < layout_.knots; ++k) {
    for (int j = 0; j < n; ++j)
      for (int i = j; i < n; ++i)
        *values++ = d.q_q[k * n2 + j * n + i] + (i == j ? 2.0 * objective_factor : 0.0);
    for (int j = 0; j < n; ++j)
      for (int i = j; i < n; ++i) *values++ = d.q_dot_q_dot[k * n2 + j * n + i];
    for (const Vector* part : {&d.q_q_dot, &d.q_q_ddot}) {
      std::copy_n(part->data() + k * n2, n2, values);
      values += n2;
    }
    for (const Vector* part : {&d.q_theta, &d.theta_theta}) {
      std::copy_n(part->data() + k * n, n, values);
      values += n;
    }
    for (int i = 0; i < n; ++i) *values++ = 2.0 * objective_factor * objective_.input_weights()[i];
  }
}

}  // namespace exactarm::ocp
