"""Simulated warming machine tools with known limits, written apart from the estimators they are used to test."""
