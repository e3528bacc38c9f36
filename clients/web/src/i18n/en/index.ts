// All English texts; their form is the form of every language.

export * from "./attend";
export * from "./common";
export * from "./faults";
export * from "./lobby";
export * from "./organise";
export * from "./people";
export * from "./replay";
export * from "./rules";
export * from "./studies";
export * from "./table";
export * from "./tournaments";
export * from "./tutorial";
export * from "./wizard";
