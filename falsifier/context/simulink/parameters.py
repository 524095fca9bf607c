"""Which parameters of a block carry meaning; the others say how it is drawn or generated."""

from collections.abc import Mapping

_SATURATION = ("LimitOutput", "UpperSaturationLimit", "LowerSaturationLimit")
_TABLE = tuple(f"BreakpointsForDimension{i}" for i in range(1, 6))
# By block type, with the names that the format gives them; the sample time is added to all.
_MEANINGFUL: Mapping[str, tuple[str, ...]] = {
    "Abs": (),
    "Assertion": (),
    "Backlash": ("BacklashWidth", "InitialOutput"),
    "BusCreator": ("Inputs",),
    "BusSelector": ("OutputSignals",),
    "Constant": ("Value",),
    "DataTypeConversion": (),
    "DataStoreMemory": ("DataStoreName", "InitialValue"),
    "DataStoreRead": ("DataStoreName",),
    "DataStoreWrite": ("DataStoreName",),
    "DeadZone": ("LowerValue", "UpperValue"),
    "Delay": ("DelayLength", "InitialCondition"),
    "Demux": ("Outputs",),
    "Derivative": (),
    "DiscreteFilter": ("Numerator", "Denominator", "InitialStates"),
    "DiscreteIntegrator": ("gainval", "InitialCondition", "IntegratorMethod", *_SATURATION),
    "DiscretePulseGenerator": ("Amplitude", "Period", "PulseWidth", "PhaseDelay"),
    "DiscreteStateSpace": ("A", "B", "C", "D", "X0", "InitialCondition"),
    "DiscreteTransferFcn": ("Numerator", "Denominator", "InitialStates"),
    "DiscreteZeroPole": ("Zeros", "Poles", "Gain"),
    "EnablePort": ("StatesWhenEnabling",),
    "Fcn": ("Expr",),
    "From": ("GotoTag",),
    "Gain": ("Gain",),
    "Goto": ("GotoTag", "TagVisibility"),
    "Ground": (),
    "HitCross": ("HitCrossingOffset", "HitCrossingDirection"),
    "If": ("IfExpression", "ElseIfExpressions"),
    "InitialCondition": ("Value",),
    "Inport": ("OutMin", "OutMax"),
    "Integrator": ("InitialCondition", "ExternalReset", *_SATURATION),
    "Logic": ("Operator",),
    "Lookup": ("InputValues", "OutputValues", "Table"),
    "Lookup2D": ("RowIndex", "ColumnIndex", "Table"),
    "Lookup_n-D": (*_TABLE, "Table", "InterpMethod", "ExtrapMethod"),
    "Math": ("Operator",),
    "Memory": ("X0", "InitialCondition"),
    "Merge": ("InitialOutput",),
    "MinMax": ("Function",),
    "MultiPortSwitch": ("DataPortIndices",),
    "Mux": (),
    "Outport": ("InitialOutput", "OutMin", "OutMax"),
    "Product": ("Inputs",),
    "Quantizer": ("QuantizationInterval",),
    "RateLimiter": ("RisingSlewLimit", "FallingSlewLimit", "risingSlewLimit", "fallingSlewLimit"),
    "RateTransition": ("OutPortSampleTime",),
    "Relay": ("OnSwitchValue", "OffSwitchValue", "OnOutputValue", "OffOutputValue"),
    "RelationalOperator": ("Operator",),
    "Rounding": ("Operator",),
    "Saturate": ("UpperLimit", "LowerLimit"),
    "Saturation": ("UpperLimit", "LowerLimit"),
    "Scope": (),
    "Selector": ("Indices", "IndexOptions"),
    "SignalConversion": (),
    "Signum": (),
    "Sin": ("Amplitude", "Frequency", "Phase", "Bias"),
    "StateSpace": ("A", "B", "C", "D", "X0", "InitialCondition"),
    "Step": ("Time", "Before", "After"),
    "SubSystem": (),
    "Sum": ("Inputs",),
    "Switch": ("Criteria", "Threshold"),
    "Terminator": (),
    "ToWorkspace": ("VariableName",),
    "TransferFcn": ("Numerator", "Denominator"),
    "TransportDelay": ("DelayTime", "InitialOutput"),
    "TriggerPort": ("TriggerType",),
    "Trigonometry": ("Operator",),
    "UnitDelay": ("X0", "InitialCondition"),
    "VariableTransportDelay": ("MaximumDelay", "InitialOutput"),
    "ZeroOrderHold": (),
    "ZeroPole": ("Zeros", "Poles", "Gain"),
}
# Of blocks that are not listed (masks, references, S-functions), everything counts but these.
_DRAWN_NAMES = """
    BlockType Name SID Position ZOrder Ports FontName FontSize FontWeight FontAngle ForegroundColor
    BackgroundColor DropShadow ShowName NamePlacement BlockRotation BlockMirror Orientation Tag
    LibraryVersion SourceBlock SourceType ContentPreviewEnabled UserDataPersistent UserData
    Description LinkData AttributesFormatString Priority RequestExecContextInheritance
    HideAutomaticName IconDisplay MaskDisplay MaskIconFrame MaskIconOpaque MaskIconRotate
    MaskIconUnits MaskSelfModifiable SystemSampleTime ShowPortLabels SourceProductName
    SourceProductBaseCode MultiThreadCoSim OutDataTypeStr InputSameDT SaturateOnIntegerOverflow
    RndMeth LockScale SampleTime Commented Port ModelNameDialog ModelFile ModelName
    ReferencedSubsystem PreCopyFcn CopyFcn OpenFcn LoadFcn
"""
_DRAWN = frozenset(_DRAWN_NAMES.split())
_TYPES = ("DataTypeStr", "DataType", "DataTypeName", "ParamMin", "ParamMax")
# Values that say nothing: inherited sample times, no limits, off.
_EMPTY = frozenset(("", "[]", "-1", "off", "none"))
_KEPT_EVEN_IF_EMPTY = frozenset(
    ("Value", "Gain", "Threshold", "UpperLimit", "LowerLimit", "gainval", "Operator")
)
_LONGEST_VALUE = 2000


def meaningful(
    kind: str, stated: Mapping[str, str], defaults: Mapping[str, str]
) -> tuple[tuple[str, str], ...]:
    """Return the parameters of a block that carry meaning, as pairs of name and value.

    Args:
        kind: the block's type.
        stated: what the file states of the block.
        defaults: what it states of all blocks of this type.
    """
    names = _MEANINGFUL.get(kind)
    if names is None:
        found = {name: value for name, value in stated.items() if not _is_drawn(name, value)}
    else:
        everything = {**defaults, **stated}
        found = {name: everything[name] for name in names if name in everything}
    if (found.get("LimitOutput") or "off") == "off":
        found = {name: value for name, value in found.items() if name not in _SATURATION}
    sample = stated.get("SampleTime", "")
    if kind not in ("Constant", "SubSystem") or sample not in ("inf", "-1"):
        found["SampleTime"] = sample
    return tuple(
        (name, _cut(" ".join(value.split())))
        for name, value in found.items()
        if value.strip() not in _EMPTY or (name in _KEPT_EVEN_IF_EMPTY and value.strip())
    )


def _is_drawn(name: str, value: str) -> bool:
    """Whether a parameter says how a block is drawn or which types it has; library blocks state dozens."""
    return name in _DRAWN or name.startswith("Mask") or name.endswith(_TYPES) or value.startswith("Inherit")


def _cut(value: str) -> str:
    if len(value) <= _LONGEST_VALUE:
        return value
    return f"{value[:_LONGEST_VALUE]} ... ({len(value):,} characters)"
