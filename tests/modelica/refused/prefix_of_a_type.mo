model M
  connector RealInput = input Real;  // error: 'input' in the short definition of 'RealInput'
  RealInput u;
equation
end M;
