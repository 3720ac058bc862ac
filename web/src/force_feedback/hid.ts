/** What WebHID says of a device's report descriptor (WICG WebHID, HIDCollectionInfo), as far as it is used here. */
export interface HidCollection {
  readonly usagePage: number;
  readonly usage: number;
  readonly children: readonly HidCollection[];
  readonly outputReports: readonly HidReport[];
  readonly featureReports: readonly HidReport[];
}

export interface HidReport {
  readonly reportId: number; // 0: the device has no report ids
  readonly items: readonly HidItem[]; // in the order of their bits
}

/** One main item: `reportCount` fields of `reportSize` bits. */
export interface HidItem {
  readonly isArray: boolean; // each field holds the index of one of the usages
  readonly isConstant: boolean; // padding
  readonly isRange: boolean; // usageMinimum to usageMaximum instead of usages
  readonly usages: readonly number[]; // 32 bits: page, then usage
  readonly usageMinimum: number;
  readonly usageMaximum: number;
  readonly reportSize: number; // bits
  readonly reportCount: number;
  readonly unitExponent: number; // -3: thousandths
  readonly logicalMinimum: number;
  readonly logicalMaximum: number;
  readonly physicalMinimum: number;
  readonly physicalMaximum: number;
}
