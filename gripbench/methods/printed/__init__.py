"""What papers print and gripbench corrects: functions in place of a method's, a file a paper."""
