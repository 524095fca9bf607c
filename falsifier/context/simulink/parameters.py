"""Which parameters of a block carry meaning; the others say how it is drawn or generated."""

from collections.abc import Mapping

from falsifier.core.words import shortened

_SATURATION = ("LimitOutput", "UpperSaturationLimit", "LowerSaturationLimit")
# Of these types of blocks, only the parameters below count.
_BLOCKS = """
    Abs Assertion Backlash BusCreator BusSelector Constant DataStoreMemory DataStoreRead DataStoreWrite
    DataTypeConversion DeadZone Delay Demux Derivative DiscreteFilter DiscreteIntegrator
    DiscretePulseGenerator DiscreteStateSpace DiscreteTransferFcn DiscreteZeroPole EnablePort Fcn From
    Gain Goto Ground HitCross If InitialCondition Inport Integrator Logic Lookup Lookup2D Lookup_n-D
    Math Memory Merge MinMax MultiPortSwitch Mux Outport Product Quantizer RateLimiter RateTransition
    RelationalOperator Relay Rounding Saturate Saturation Scope Selector SignalConversion Signum Sin
    StateSpace Step SubSystem Sum Switch Terminator ToWorkspace TransferFcn TransportDelay TriggerPort
    Trigonometry UnitDelay VariableTransportDelay ZeroOrderHold ZeroPole
"""
# Parameters that count, by the names that the format gives them; the sample time is added to all.
_NAMES = """
    A After Amplitude B BacklashWidth Before Bias BreakpointsForDimension1 BreakpointsForDimension2
    BreakpointsForDimension3 BreakpointsForDimension4 BreakpointsForDimension5 C ColumnIndex Criteria D
    DataPortIndices DataStoreName DelayLength DelayTime Denominator ElseIfExpressions Expr ExternalReset
    ExtrapMethod FallingSlewLimit Frequency Function Gain GotoTag HitCrossingDirection HitCrossingOffset
    IfExpression IndexOptions Indices InitialCondition InitialOutput InitialStates InitialValue
    InputValues Inputs IntegratorMethod InterpMethod LimitOutput LowerLimit LowerSaturationLimit
    LowerValue MaximumDelay Numerator OffOutputValue OffSwitchValue OnOutputValue OnSwitchValue Operator
    OutMax OutMin OutPortSampleTime OutputSignals OutputValues Outputs Period Phase PhaseDelay Poles
    PulseWidth QuantizationInterval RisingSlewLimit RowIndex StatesWhenEnabling Table TagVisibility
    Threshold Time TriggerType UpperLimit UpperSaturationLimit UpperValue Value VariableName X0 Zeros
    fallingSlewLimit gainval risingSlewLimit
"""
_LISTED, _MEANINGFUL = frozenset(_BLOCKS.split()), frozenset(_NAMES.split())
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

    The ``defaults`` are what the file states of all blocks of this type.
    """
    if kind in _LISTED:
        everything = {**stated, **defaults, **stated}  # what is stated comes first, and counts
        found = {name: value for name, value in everything.items() if name in _MEANINGFUL}
    else:
        found = {name: value for name, value in stated.items() if not _is_drawn(name, value)}
    if (found.get("LimitOutput") or "off") == "off":
        found = {name: value for name, value in found.items() if name not in _SATURATION}
    sample = stated.get("SampleTime", "")
    if kind not in ("Constant", "SubSystem") or sample not in ("inf", "-1"):
        found["SampleTime"] = sample
    return tuple(
        (name, shortened(" ".join(value.split()), _LONGEST_VALUE))
        for name, value in found.items()
        if value.strip() not in _EMPTY or (name in _KEPT_EVEN_IF_EMPTY and value.strip())
    )


def _is_drawn(name: str, value: str) -> bool:
    """Whether a parameter says how a block is drawn or which types it has; library blocks state dozens."""
    return name in _DRAWN or name.startswith("Mask") or name.endswith(_TYPES) or value.startswith("Inherit")
