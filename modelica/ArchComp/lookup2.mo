within ArchComp;
function lookup2 "Bilinear interpolation in a matrix of evenly spaced values; the outer cells are continued outside"
  input Real values[:, :];
  input Real row "1 is the first row, 1.5 half-way to the second";
  input Real column "The same for the columns";
  output Real y;
protected
  Integer i "Row of the cell";
  Integer j "Column of the cell";
  Real here "Value in row i";
  Real next "Value in row i + 1";
algorithm
  i := min(max(integer(floor(row)), 1), size(values, 1) - 1);
  j := min(max(integer(floor(column)), 1), size(values, 2) - 1);
  here := values[i, j] + (column - j) * (values[i, j + 1] - values[i, j]);
  next := values[i + 1, j] + (column - j) * (values[i + 1, j + 1] - values[i + 1, j]);
  y := here + (row - i) * (next - here);
end lookup2;
