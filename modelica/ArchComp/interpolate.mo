within ArchComp;
function interpolate "Linear interpolation in a table of (x, y) rows; the first and last pieces are continued outside"
  input Real table[:, 2] "Rows in the order of rising x";
  input Real x;
  output Real y;
protected
  Integer i "Piece of the table";
algorithm
  i := 1;
  while i < size(table, 1) - 1 and x >= table[i + 1, 1] loop
    i := i + 1;
  end while;
  y := table[i, 2] + (x - table[i, 1]) * (table[i + 1, 2] - table[i, 2]) / (table[i + 1, 1] - table[i, 1]);
end interpolate;
