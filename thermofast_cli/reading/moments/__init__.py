"""When each reading was taken: which columns say so, stamps of many forms, zones, and the order of the rows."""
