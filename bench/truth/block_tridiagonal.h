// Cholesky for the stiffness of a structured mesh of quadratic hexahedra, slab by slab. A slab meets the one before it
// in a single layer of nodes, so everything is dense, contiguous and cubic in the size of a layer.
#pragma once

#include <vector>

#include <Eigen/Dense>

namespace meshless::truth {

class BlockTridiagonal {
 public:
  /// `layers` = 2 slabs + 1; unknowns are numbered layer by layer, `layer_size` in each.
  BlockTridiagonal(int layers, int layer_size);

  void setZero();
  /// Entries above the diagonal are ignored: the matrix is symmetric.
  void add(int row, int column, double value);
  /// False where the matrix is not positive definite. Overwrites the entries.
  bool factor();
  Eigen::VectorXd solve(const Eigen::VectorXd& right_hand_side) const;
  /// Only before factor().
  double diagonal(int row) const;

 private:
  int blockOf(int row) const;
  int offset(int block) const { return block == 0 ? 0 : (2 * block + 1) * layer_size_; }

  int layer_size_;
  std::vector<Eigen::MatrixXd> diagonal_;  // lower halves; after factor() their Cholesky factors
  std::vector<Eigen::MatrixXd> coupling_;  // [b]: rows are the last layer of block b-1, columns are block b
};

}  // namespace meshless::truth
