model M
  parameter String s = "a";  // error: String variables are not supported
equation
end M;
