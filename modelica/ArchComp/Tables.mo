within ArchComp;
package Tables "Lookup tables with linear extrapolation"
  function segment "Number of the table segment that contains a value; the outermost segments extend to infinity"
    input Real x "Value";
    input Real axis[:] "Increasing break points";
    output Integer k "axis[k] <= x < axis[k + 1] if x is within the table";
  protected
    Integer high;
    Integer middle;
  algorithm
    k := 1;
    high := size(axis, 1);
    while high - k > 1 loop
      middle := div(k + high, 2);
      if x < axis[middle] then
        high := middle;
      else
        k := middle;
      end if;
    end while;
  end segment;

  function linear "Piecewise linear function of one variable"
    input Real x "Value";
    input Real axis[:] "Increasing break points";
    input Real table[size(axis, 1)] "Function values at the break points";
    output Real y "Function value";
  protected
    Integer k;
  algorithm
    k := segment(x, axis);
    y := table[k] + (table[k + 1] - table[k]) * (x - axis[k]) / (axis[k + 1] - axis[k]);
  end linear;

  function bilinear "Piecewise bilinear function of two variables"
    input Real r "Value along the rows";
    input Real c "Value along the columns";
    input Real rows[:] "Increasing break points of the rows";
    input Real columns[:] "Increasing break points of the columns";
    input Real table[size(rows, 1), size(columns, 1)] "Function values at the break points";
    output Real y "Function value";
  protected
    Integer i;
    Integer j;
    Real here "Position between two columns, from 0 to 1 within the table";
    Real left;
    Real right;
  algorithm
    i := segment(r, rows);
    j := segment(c, columns);
    here := (c - columns[j]) / (columns[j + 1] - columns[j]);
    left := table[i, j] + here * (table[i, j + 1] - table[i, j]);
    right := table[i + 1, j] + here * (table[i + 1, j + 1] - table[i + 1, j]);
    y := left + (r - rows[i]) / (rows[i + 1] - rows[i]) * (right - left);
  end bilinear;
end Tables;
