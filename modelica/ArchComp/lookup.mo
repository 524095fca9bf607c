within ArchComp;
function lookup "Linear interpolation in a table of evenly spaced values; the first and last pieces are continued outside"
  input Real values[:];
  input Real position "1 is the first value, 2 the second, 1.5 half-way between them";
  output Real y;
protected
  Integer i "Piece of the table";
algorithm
  i := min(max(integer(floor(position)), 1), size(values, 1) - 1);
  y := values[i] + (position - i) * (values[i + 1] - values[i]);
end lookup;
