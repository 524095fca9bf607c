within Features;
model Functions "Functions with loops, arrays, several outputs"
  function polynomial "Horner's rule"
    input Real x;
    input Real c[:] = {1, 2};
    output Real y;
  algorithm
    y := 0;
    for i in size(c, 1):-1:1 loop
      y := y * x + c[i];
    end for;
  end polynomial;

  function digits "Digits of a positive number, at most `most`"
    input Integer number;
    input Integer most = 10;
    output Integer count;
  protected
    Integer rest = number;
  algorithm
    count := 0;
    while rest > 0 loop
      rest := div(rest, 10);
      count := count + 1;
      if count == most then
        break;
      end if;
    end while;
  end digits;

  function statistics "Mean and spread of a matrix by rows"
    input Real m[:, :];
    output Real mean[size(m, 1)];
    output Real largest;
  protected
    Real row[size(m, 2)];
  algorithm
    largest := m[1, 1];
    for i in 1:size(m, 1) loop
      row := m[i, :];
      mean[i] := sum(row) / size(m, 2);
      largest := max(largest, max(row));
    end for;
  end statistics;

  function early
    input Real x;
    output Real y;
  algorithm
    y := 1;
    if x > 0.5 then
      return;
    end if;
    y := 2 + polynomial(x, {0, 1});
  end early;

  constant Real table[2, 3] = [1, 2, 3; 4, 5, 9];
  parameter Real p[3] = {1, 0, 2};
  output Real value;
  output Real linear;
  output Integer count;
  output Integer few;
  output Real mean[2];
  output Real largest;
  output Real mixed;
  output Real jump;
  output Real chosen;
protected
  Integer index(start = 1);
equation
  value = polynomial(time, c = p);
  linear = polynomial(time);
  count = digits(12345);
  few = digits(most = 2, number = 12345);
  (mean, largest) = statistics(table);
  mixed = sum(rows(time)) + squares[steps];
  jump = early(time);
  index = if time < 0.5 then 1 else 3;
  chosen = squares[index] + p[index];
public
  function rows
    input Real x;
    output Real y[2];
  algorithm
    y := {x, 2 * x};
  end rows;
  annotation(experiment(StopTime = 1));
end Functions;
