within Features;
model Enumerated "Enumerations as input, parameter, state and output: counts commands of one kind"
  type Command = enumeration(Wait "Do nothing", Up "Count up", Down "Count down") "What to do";
  type Order = Command(start = Command.Down) "The same with a start value";
  input Command command "What to do now";
  parameter Command counted = Command.Up "What is counted";
  output Integer count(start = 0) "How often it came";
  output Order before "The last other command";
  output Integer code "Both as digits";
  output Boolean later "Whether the command stands behind the counted one";
  output Real gain[3];
protected
  constant Command idle = Command.Wait;
  Command kept[2](start = {Command.Up, Command.Down});
equation
  code = 10 * Integer(command) + Integer(before);
  later = command > counted;
  gain = {if command == idle then 0 else 1, if kept[1] <> kept[2] then 0.5 else 2, Integer(kept[2])};
  when change(command) then
    before = pre(command);
    count = pre(count) + (if command == counted then 1 else 0);
  end when;
algorithm
  when sample(0.5, 0.5) then
    kept := {command, pre(kept[1])};
  end when;
  annotation(experiment(StopTime = 1));
end Enumerated;
