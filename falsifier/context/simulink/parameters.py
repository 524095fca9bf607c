"""Which parameters of a block carry meaning; the others say how it is drawn or generated."""

from collections.abc import Mapping

_SATURATION = ("LimitOutput", "UpperSaturationLimit", "LowerSaturationLimit")
# Block types with the parameters that count, by the names that the format gives them; the sample time is
# added to all.
_LISTED = r"""
    Abs Assertion DataTypeConversion Derivative Ground Mux Scope SignalConversion Signum SubSystem \
        Terminator ZeroOrderHold:
    Backlash: BacklashWidth InitialOutput
    BusCreator Product Sum: Inputs
    BusSelector: OutputSignals
    Constant InitialCondition: Value
    DataStoreMemory: DataStoreName InitialValue
    DataStoreRead DataStoreWrite: DataStoreName
    DeadZone: LowerValue UpperValue
    Delay: DelayLength InitialCondition
    Demux: Outputs
    DiscreteFilter DiscreteTransferFcn: Numerator Denominator InitialStates
    DiscreteIntegrator: gainval InitialCondition IntegratorMethod LimitOutput UpperSaturationLimit \
        LowerSaturationLimit
    DiscretePulseGenerator: Amplitude Period PulseWidth PhaseDelay
    DiscreteStateSpace StateSpace: A B C D X0 InitialCondition
    DiscreteZeroPole ZeroPole: Zeros Poles Gain
    EnablePort: StatesWhenEnabling
    Fcn: Expr
    From: GotoTag
    Gain: Gain
    Goto: GotoTag TagVisibility
    HitCross: HitCrossingOffset HitCrossingDirection
    If: IfExpression ElseIfExpressions
    Inport: OutMin OutMax
    Integrator: InitialCondition ExternalReset LimitOutput UpperSaturationLimit LowerSaturationLimit
    Logic Math RelationalOperator Rounding Trigonometry: Operator
    Lookup: InputValues OutputValues Table
    Lookup2D: RowIndex ColumnIndex Table
    Lookup_n-D: BreakpointsForDimension1 BreakpointsForDimension2 BreakpointsForDimension3 \
        BreakpointsForDimension4 BreakpointsForDimension5 Table InterpMethod ExtrapMethod
    Memory UnitDelay: X0 InitialCondition
    Merge: InitialOutput
    MinMax: Function
    MultiPortSwitch: DataPortIndices
    Outport: InitialOutput OutMin OutMax
    Quantizer: QuantizationInterval
    RateLimiter: RisingSlewLimit FallingSlewLimit risingSlewLimit fallingSlewLimit
    RateTransition: OutPortSampleTime
    Relay: OnSwitchValue OffSwitchValue OnOutputValue OffOutputValue
    Saturate Saturation: UpperLimit LowerLimit
    Selector: Indices IndexOptions
    Sin: Amplitude Frequency Phase Bias
    Step: Time Before After
    Switch: Criteria Threshold
    ToWorkspace: VariableName
    TransferFcn: Numerator Denominator
    TransportDelay: DelayTime InitialOutput
    TriggerPort: TriggerType
    VariableTransportDelay: MaximumDelay InitialOutput
"""
_MEANINGFUL: Mapping[str, tuple[str, ...]] = {
    kind: tuple(names.split())
    for kinds, _, names in (line.partition(":") for line in _LISTED.replace("\\\n", "").splitlines())
    for kind in kinds.split()
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
