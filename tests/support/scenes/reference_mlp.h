// The network of nerf/fields/mlp.h row by row in plain loops, templated on the scalar: in double the oracle
// of its fast implementations.
#pragma once

#include <algorithm>
#include <vector>

#include "nerf/fields/mlp.h"

namespace tests {

template <typename Scalar>
class ReferenceMlp {
 public:
  using Vector = std::vector<Scalar>;

  struct Row {
    std::vector<Vector> inputs;  // of each layer
    Scalar density;
    Vector logits;
  };

  ReferenceMlp(const nerf::MlpOptions& options, const std::vector<float>& new_weights)
      : weights(new_weights.begin(), new_weights.end()),
        layers_(nerf::Layers(options)),
        depth_(static_cast<std::size_t>(options.depth)),
        skip_(static_cast<std::size_t>(options.skip)),
        width_(static_cast<std::size_t>(options.width)) {}

  Row Forward(const Vector& position, const Vector& direction) const {
    Row row;
    Vector h = position;
    for (std::size_t l = 0; l < depth_; ++l)
      h = Relu(Linear(l, l == skip_ + 1 ? Joined(position, h) : h, &row));
    row.density = Linear(depth_, h, &row)[0];
    const Vector feature = Linear(depth_ + 1, h, &row);
    const Vector hidden = Relu(Linear(depth_ + 2, Joined(feature, direction), &row));
    row.logits = Linear(depth_ + 3, hidden, &row);
    return row;
  }

  // Adds d loss / d weights of one row to `gradients`.
  void Backward(const Row& row,
                Scalar density_gradient,
                const Vector& logit_gradients,
                Vector* gradients) const {
    const Vector hidden =
        Masked(LinearBack(depth_ + 3, logit_gradients, row, gradients), row.inputs[depth_ + 3]);
    Vector feature = LinearBack(depth_ + 2, hidden, row, gradients);
    feature.resize(width_);
    Vector h = LinearBack(depth_ + 1, feature, row, gradients);
    const Vector from_density = LinearBack(depth_, {density_gradient}, row, gradients);
    for (std::size_t i = 0; i < width_; ++i) h[i] += from_density[i];
    for (std::size_t l = depth_; l-- > 0;)
      h = Tail(LinearBack(l, Masked(h, Tail(row.inputs[l + 1])), row, gradients));
  }

  Vector weights;

 private:
  static Vector Relu(Vector x) {
    for (Scalar& value : x) value = std::max(value, Scalar(0));
    return x;
  }
  static Vector Joined(Vector a, const Vector& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
  }
  static Vector Masked(Vector gradient, const Vector& activation) {
    for (std::size_t i = 0; i < gradient.size(); ++i) gradient[i] = activation[i] > 0 ? gradient[i] : 0;
    return gradient;
  }
  // What belongs to h among a trunk layer's inputs, behind the position code where that enters again.
  Vector Tail(const Vector& x) const {
    return x.size() <= width_ ? x : Vector(x.end() - static_cast<std::ptrdiff_t>(width_), x.end());
  }

  Vector Linear(std::size_t l, const Vector& x, Row* row) const {
    row->inputs.push_back(x);
    Vector y(static_cast<std::size_t>(layers_[l].outputs));
    for (std::size_t o = 0; o < y.size(); ++o) {
      y[o] = weights[layers_[l].biases + o];
      const Scalar* w = &weights[layers_[l].weights + o * x.size()];
      for (std::size_t i = 0; i < x.size(); ++i) y[o] += w[i] * x[i];
    }
    return y;
  }

  Vector LinearBack(std::size_t l, const Vector& y_gradient, const Row& row, Vector* gradients) const {
    const Vector& x = row.inputs[l];
    Vector x_gradient(x.size(), Scalar(0));
    for (std::size_t o = 0; o < y_gradient.size(); ++o) {
      if (y_gradient[o] == 0) continue;
      (*gradients)[layers_[l].biases + o] += y_gradient[o];
      const std::size_t at = layers_[l].weights + o * x.size();
      for (std::size_t i = 0; i < x.size(); ++i) {
        (*gradients)[at + i] += y_gradient[o] * x[i];
        x_gradient[i] += y_gradient[o] * weights[at + i];
      }
    }
    return x_gradient;
  }

  std::vector<nerf::MlpLayer> layers_;
  std::size_t depth_, skip_, width_;
};

}  // namespace tests
